// SPDX-License-Identifier: BSD-3-Clause
#include "geometry/motion_choice.hpp"

#include <algorithm>

namespace orbslam {
namespace {

constexpr double kInlierShare = 0.9;   // of the model's inliers, that the best motion must place
constexpr double kSecondShare = 0.75;  // of the best one's points, for a homography's second best
constexpr double kSimilarShare = 0.7;  // the same for each other motion of a fundamental matrix

std::size_t best_of(const std::vector<MotionScore>& scores) {
  const auto best = std::max_element(
      scores.begin(), scores.end(),
      [](const MotionScore& a, const MotionScore& b) { return a.n_good < b.n_good; });
  return static_cast<std::size_t>(best - scores.begin());
}

// Low parallax is reported before ambiguity, because it causes ambiguity.
TwoViewOutcome judge(bool enough_points, bool enough_parallax, bool unique) {
  if (!enough_points) return TwoViewOutcome::too_few_points;
  if (!enough_parallax) return TwoViewOutcome::low_parallax;
  return unique ? TwoViewOutcome::reconstructed : TwoViewOutcome::ambiguous_motion;
}

}  // namespace

const char* to_string(TwoViewOutcome outcome) {
  switch (outcome) {
    case TwoViewOutcome::reconstructed:
      return "reconstructed";
    case TwoViewOutcome::too_few_matches:
      return "too_few_matches";
    case TwoViewOutcome::degenerate_points:
      return "degenerate_points";
    case TwoViewOutcome::no_model:
      return "no_model";
    case TwoViewOutcome::degenerate_plane:
      return "degenerate_plane";
    case TwoViewOutcome::too_few_points:
      return "too_few_points";
    case TwoViewOutcome::low_parallax:
      return "low_parallax";
    case TwoViewOutcome::ambiguous_motion:
      return "ambiguous_motion";
  }
  return "unknown";
}

MotionChoice choose_homography_motion(const std::vector<MotionScore>& scores, std::size_t n_inliers,
                                      const MotionLimits& limits) {
  const std::size_t index = best_of(scores);
  const auto best = static_cast<double>(scores[index].n_good);
  std::size_t second = 0;
  for (std::size_t i = 0; i < scores.size(); ++i) {
    if (i != index) second = std::max(second, scores[i].n_good);
  }
  const bool enough_points = scores[index].n_good > limits.min_points &&
                             best > kInlierShare * static_cast<double>(n_inliers);
  const bool unique = static_cast<double>(second) < kSecondShare * best;
  return {judge(enough_points, scores[index].parallax >= limits.min_parallax, unique), index};
}

MotionChoice choose_fundamental_motion(const std::vector<MotionScore>& scores,
                                       std::size_t n_inliers, const MotionLimits& limits) {
  const std::size_t index = best_of(scores);
  const auto best = static_cast<double>(scores[index].n_good);
  const auto most = static_cast<std::size_t>(kInlierShare * static_cast<double>(n_inliers));
  const bool enough_points = scores[index].n_good >= std::max(most, limits.min_points);
  const auto similar = std::count_if(scores.begin(), scores.end(), [&](const MotionScore& score) {
    return static_cast<double>(score.n_good) > kSimilarShare * best;
  });
  return {judge(enough_points, scores[index].parallax > limits.min_parallax, similar <= 1), index};
}

}  // namespace orbslam
