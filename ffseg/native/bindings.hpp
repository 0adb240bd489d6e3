// One binding function per part of the core; each lives beside its part.
#pragma once
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>

void bind_edges(nanobind::module_& m);
void bind_evidence(nanobind::module_& m);
void bind_freeform(nanobind::module_& m);
void bind_raster(nanobind::module_& m);
void bind_region(nanobind::module_& m);
void bind_text(nanobind::module_& m);
void bind_levelset(nanobind::module_& m);
void bind_measures(nanobind::module_& m);
void bind_compression(nanobind::module_& m);
void bind_pairs(nanobind::module_& m);
void bind_paper(nanobind::module_& m);
void bind_snake(nanobind::module_& m);
