#include "edges/enlarged.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <numeric>

#include "common/lanes.hpp"

namespace ffseg::edges {
namespace {

FFSEG_CLONES
void add_scaled(const float* weights, float by, float* __restrict sums, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) sums[i] += by * weights[i];
}

std::size_t beyond(const float* values, std::size_t count, float limit) {
    return static_cast<std::size_t>(
        std::count_if(values, values + count, [limit](float value) { return std::abs(value) > limit; }));
}

std::size_t unlike(const float* line, std::size_t length, std::size_t factor, float rounded) {
    std::size_t found = 0;
    for (std::size_t x = factor; x < length; ++x) found += std::abs(line[x] - line[x - factor]) > rounded;
    return found;
}

}  // namespace

std::vector<float> liveliest(const Lines& lines, std::size_t most, std::size_t step, std::size_t skip) {
    const auto at = [&](std::size_t line, std::size_t x) -> int {
        return lines
            .first[static_cast<std::ptrdiff_t>(line) * lines.down + static_cast<std::ptrdiff_t>(x) * lines.along];
    };
    std::vector<long> change((lines.count + step - 1) / step);
    for (std::size_t i = 0; i < change.size(); ++i) {
        for (std::size_t x = skip; x < lines.length; x += skip)
            change[i] += std::abs(at(i * step, x) - at(i * step, x - skip));
    }
    std::vector<std::size_t> order(change.size());
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return change[a] > change[b]; });
    order.resize(std::min(most, order.size()));
    std::vector<float> out;
    out.reserve(order.size() * lines.length);
    for (const std::size_t line : order) {
        for (std::size_t x = 0; x < lines.length; ++x) out.push_back(static_cast<float>(at(line * step, x)));
    }
    return out;
}

std::vector<double> amiss(const float* lines, std::size_t count, std::size_t length, const Rest& rest, float rounded,
                          double most) {
    const std::size_t blocks = length / rest.size;  // what lies beyond the border is another's rule
    const std::size_t inner = blocks > 2 ? (blocks - 2) * rest.size : 0;
    std::size_t all = 0;
    for (std::size_t i = 0; i < count; ++i) all += unlike(lines + i * length + rest.size, inner, rest.factor, rounded);
    if (all == 0) return std::vector<double>(rest.kinds, std::numeric_limits<double>::infinity());
    std::vector<double> wrong(rest.kinds);
    std::vector<float> error(rest.kinds * rest.size);
    for (std::size_t at = 0; at < count * inner; at += rest.size) {
        if (*std::min_element(wrong.begin(), wrong.end()) > most * static_cast<double>(all)) break;
        const float* const block = lines + at / inner * length + rest.size + at % inner;
        std::fill(error.begin(), error.end(), 0.0f);
        for (std::size_t x = 0; x < rest.size; ++x) {
            add_scaled(rest.weights + x * error.size(), block[x], error.data(), error.size());
        }
        for (std::size_t kind = 0; kind < rest.kinds; ++kind) {
            wrong[kind] += static_cast<double>(beyond(error.data() + kind * rest.size, rest.size, rounded));
        }
    }
    for (double& share : wrong) share /= static_cast<double>(all);
    return wrong;
}

}  // namespace ffseg::edges
