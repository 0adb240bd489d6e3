#include "bindings.hpp"
#include "packing/strips.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace {

std::string_view view(const nb::bytes& data) { return {data.c_str(), data.size()}; }

std::int64_t py_lzw_size(const nb::bytes& data) {
    const std::string_view packed = view(data);
    nb::gil_scoped_release release;
    return ffseg::packing::lzw_size(packed);
}

std::int64_t py_packbits_size(const nb::bytes& data) {
    const std::string_view packed = view(data);
    nb::gil_scoped_release release;
    return ffseg::packing::packbits_size(packed);
}

}  // namespace

void bind_packing(nb::module_& m) {
    m.def("lzw_size", &py_lzw_size, "data"_a,
          "Bytes that TIFF's LZW codes stand for; -1 when a code has no meaning where it stands.");
    m.def("packbits_size", &py_packbits_size, "data"_a,
          "Bytes that PackBits runs stand for; -1 when a run goes beyond the end.");
}
