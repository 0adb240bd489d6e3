#include <algorithm>
#include <stdexcept>

#include "bindings.hpp"
#include "edges/edges.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace {

using Bytes = nb::ndarray<const std::uint8_t, nb::c_contig, nb::device::cpu>;
using Plane8 = nb::ndarray<std::uint8_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Domain = nb::ndarray<const std::uint8_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Plane16 = nb::ndarray<std::uint16_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

ffseg::GreyView view(const Bytes& image) {
    if (image.ndim() != 2 && image.ndim() != 3) throw std::invalid_argument("the image must be (H, W) or (H, W, C)");
    const std::size_t channels = image.ndim() == 3 ? image.shape(2) : 1;
    if (image.shape(0) == 0 || image.shape(1) == 0 || channels == 0) throw std::invalid_argument("the image is empty");
    if (image.shape(0) > 65535 || image.shape(1) > 65535 || channels > 4) {
        throw std::invalid_argument("the image is larger than 65535 pixels a side or has more than 4 channels");
    }
    return {image.data(), static_cast<int>(image.shape(0)), static_cast<int>(image.shape(1)),
            static_cast<int>(channels)};
}

void check_plane(const ffseg::GreyView& image, std::size_t height, std::size_t width) {
    if (height != static_cast<std::size_t>(image.height) || width != static_cast<std::size_t>(image.width)) {
        throw std::invalid_argument("the arrays differ in size");
    }
}

void py_gradient(const Bytes& image, Plane16 out) {
    const ffseg::GreyView grey = view(image);
    check_plane(grey, out.shape(0), out.shape(1));
    nb::gil_scoped_release release;
    ffseg::gradient_magnitude(grey, out.data());
}

int py_quantile(Plane16 gradient, std::optional<Domain> domain, int stride, double quantile) {
    if (stride < 1 || !(quantile >= 0.0 && quantile < 1.0)) throw std::invalid_argument("stride or quantile");
    if (domain && (domain->shape(0) != gradient.shape(0) || domain->shape(1) != gradient.shape(1))) {
        throw std::invalid_argument("the arrays differ in size");
    }
    nb::gil_scoped_release release;
    return ffseg::gradient_quantile(gradient.data(), domain ? domain->data() : nullptr,
                                    static_cast<int>(gradient.shape(0)), static_cast<int>(gradient.shape(1)), stride,
                                    quantile);
}

void py_canny(const Bytes& image, Plane16 gradient, int low, int high, Plane8 out) {
    const ffseg::GreyView grey = view(image);
    check_plane(grey, gradient.shape(0), gradient.shape(1));
    check_plane(grey, out.shape(0), out.shape(1));
    const auto clamp = [](int value) { return static_cast<std::uint16_t>(std::clamp(value, 0, 65535)); };
    nb::gil_scoped_release release;
    ffseg::canny(grey, gradient.data(), clamp(low), clamp(high), out.data());
}

}  // namespace

void bind_edges(nb::module_& m) {
    m.def("gradient_magnitude", &py_gradient, "smoothed"_a, "out"_a,
          "Sobel gradient magnitude of the strongest channel, in 1/32 grey level per pixel, into `out`.");
    m.def("gradient_quantile", &py_quantile, "gradient"_a, "domain"_a.none(), "stride"_a, "quantile"_a,
          "Quantile of every stride-th row of the stored gradient, inside the domain.");
    m.def("canny", &py_canny, "smoothed"_a, "gradient"_a, "low"_a, "high"_a, "out"_a,
          "Canny edges (255) by non-maximum suppression and hysteresis; thresholds in stored units.");
}
