#include "text/path_text.hpp"

#include <cmath>
#include <cstddef>
#include <cstdint>

namespace ffseg::text {

namespace {

constexpr double kUnits = 1e4;  // in one pixel: four digits behind the point
constexpr char kCommands[] = {'L', 'Q', 'C'};

// value * kUnits rounded to the nearest integer, ties to even: the product's own rounding error, known exactly, decides
// where the product alone shows a tie. A product that is no tie lies further from one than its error.
std::int64_t in_units(double value) {
    const double product = value * kUnits, error = std::fma(value, kUnits, -product);
    const double below = std::floor(product), beyond_half = product - below - 0.5;
    const std::int64_t units = static_cast<std::int64_t>(below);
    if (beyond_half > 0.0) return units + 1;
    if (beyond_half < 0.0) return units;
    if (error != 0.0) return error > 0.0 ? units + 1 : units;
    return units % 2 == 0 ? units : units + 1;
}

void append_point(Vec2 point, std::string& text) {
    append_number(point.x, text);
    text += ',';
    append_number(point.y, text);
    text += ' ';
}

}  // namespace

void append_number(double value, std::string& text) {
    const bool negative = value < 0.0;
    std::int64_t units = in_units(negative ? -value : value);
    if (negative && units > 0) text += '-';
    int decimals = 4;
    while (decimals > 0 && units % 10 == 0) {
        units /= 10;
        --decimals;
    }
    char digits[24];
    std::size_t size = 0;
    for (int place = 0; place <= decimals || units > 0;
         ++place) {  // from the last digit; one before the point at least
        if (place == decimals && decimals > 0) digits[size++] = '.';
        digits[size++] = static_cast<char>('0' + units % 10);
        units /= 10;
    }
    while (size > 0) text += digits[--size];
}

std::string path_text(const std::vector<Vec2>& points, int degree) {
    const std::size_t step = static_cast<std::size_t>(degree);
    std::string text = "M";
    text.reserve(points.size() * 20 + 8);
    append_point(points[0], text);
    const std::size_t last = degree == 1 ? points.size() - 1 : points.size();  // Z draws the last edge of a polygon
    for (std::size_t i = 1; i <= last; ++i) {
        if ((i - 1) % step == 0) text += kCommands[degree - 1];
        append_point(points[i % points.size()], text);
    }
    text += 'Z';
    return text;
}

}  // namespace ffseg::text
