// Patches of the current image compared with affinely warped patches of the previous one.
#pragma once
#include <cstdint>
#include <vector>

#include "common/picture.hpp"
#include "common/vec.hpp"

namespace ffseg::pairs {

struct ImagePair {
    Picture current, previous;  // of one channel
};

// d(previous pixel) / d(current pixel).
struct Warp {
    double xx = 1.0, xy = 0.0, yx = 0.0, yy = 1.0;
};

struct Symmetric2 {
    double xx = 0.0, xy = 0.0, yy = 0.0;
};

struct Alignment {
    Vec2 position;       // in the previous image
    double score;        // zero-mean normalised cross-correlation there; NaN where a patch leaves its image
    double residual;     // root mean square of the difference after gain and bias, grey levels
    Symmetric2 normal;   // sum of gradient products over the patch, (grey level / px)^2, gain removed
};

// Bilinear samples of one patch, with their mean and spread; with a stride, of every so-manieth row and column.
class ImagePatch {
public:
    explicit ImagePatch(int radius, int stride = 1);
    // False, with nothing sampled, where it does not lie inside the image; `fill` leaves mean and spread as they were.
    bool sample(const Picture& image, Vec2 center, const Warp& warp);
    bool fill(const Picture& image, Vec2 center, const Warp& warp);
    double correlation(const ImagePatch& other) const;
    const std::vector<double>& values() const { return values_; }
    double mean() const { return mean_; }
    double spread() const { return spread_; }
    int radius() const { return radius_; }

private:
    int radius_, stride_;
    std::vector<double> values_;
    double mean_ = 0.0, spread_ = 0.0;  // spread: root of the sum of squared deviations
};

// Places in the previous image that a patch of the current one is compared with.
struct Candidates {
    std::vector<Vec2> places;
    std::vector<Warp> warps;
};

// Score of the patch round `center` against each candidate; a candidate whose every second row and column score below
// `hopeless` keeps that score.
void patch_scores(const ImagePair& pair, Vec2 center, const Candidates& candidates, int radius, double hopeless,
                  double* scores);

// Move `start` to where the warped previous patch fits best: Gauss-Newton with gain and bias, at most `steps`.
Alignment align_patch(const ImagePair& pair, Vec2 center, Vec2 start, const Warp& warp, int radius, int steps);

}  // namespace ffseg::pairs
