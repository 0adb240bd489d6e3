#include "bindings.hpp"
void bind_edges(nanobind::module_&) {}
