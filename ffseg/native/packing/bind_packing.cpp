#include <stdexcept>

#include "bindings.hpp"
#include "packing/fax.hpp"
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

bool py_fax_is_whole(const nb::bytes& data, int width, int rows, int coding, bool two_dimensional) {
    if (width < 1 || rows < 1) throw std::invalid_argument("a fax has at least one row of one pixel");
    if (coding < 2 || coding > 4) throw std::invalid_argument("the coding of a fax is TIFF's number 2, 3 or 4");
    const std::string_view packed = view(data);
    const auto kind = static_cast<ffseg::packing::FaxKind::Coding>(coding - 2);
    nb::gil_scoped_release release;
    return ffseg::packing::fax_is_whole(packed, width, rows, {kind, two_dimensional});
}

}  // namespace

void bind_packing(nb::module_& m) {
    m.def("lzw_size", &py_lzw_size, "data"_a,
          "Bytes that TIFF's LZW codes stand for; -1 when a code has no meaning where it stands.");
    m.def("packbits_size", &py_packbits_size, "data"_a,
          "Bytes that PackBits runs stand for; -1 when a run goes beyond the end.");
    m.def("fax_is_whole", &py_fax_is_whole, "data"_a, "width"_a, "rows"_a, "coding"_a, "two_dimensional"_a,
          "Whether fax data (TIFF compression 2, 3 or 4) holds whole rows and nothing but end codes behind them.");
}
