// SPDX-License-Identifier: BSD-3-Clause
#include "geometry/two_view.hpp"

#include <cmath>
#include <functional>
#include <stdexcept>
#include <string>

#include "geometry/fundamental.hpp"
#include "geometry/homography.hpp"
#include "geometry/motion_check.hpp"
#include "geometry/ransac.hpp"

namespace orbslam {
namespace {

constexpr double homography_threshold = 0.40;
constexpr double general_scene = 1.1;  // matches of F by those of H, from which on it is no plane
constexpr double max_chi2 = 4.0;       // squared reprojection error over sigma^2 of a good pair
constexpr double alternative_share = 0.5;  // least share of the best motion's points
constexpr std::size_t sample_size = std::tuple_size_v<EightPairs>;

void check_options(const TwoViewOptions& options) {
  if (!(options.sigma > 0) || options.n_samples < 1 || options.min_matches < sample_size) {
    throw std::invalid_argument(
        "two-view options: sigma must be positive, n_samples at least 1 and min_matches at least "
        "8");
  }
}

void check_samples(const std::vector<EightPairs>& samples, std::size_t n_matches) {
  for (const EightPairs& sample : samples) {
    for (const int index : sample) {
      if (index >= 0 && static_cast<std::size_t>(index) < n_matches) continue;
      throw std::invalid_argument("a sample names match " + std::to_string(index) + " of " +
                                  std::to_string(n_matches));
    }
  }
}

/// Runs both jobs, one of them in the helper if there is one.
void run_both(WorkerThread* helper, const std::function<void()>& first,
              const std::function<void()>& second) {
  if (helper == nullptr) {
    first();
    second();
    return;
  }
  helper->start(first);
  try {
    second();
  } catch (...) {
    // The helper's job uses this call's variables.
    helper->finish();
    throw;
  }
  helper->finish();
}

struct Models {
  ScoredModel homography, fundamental;
};

Models estimate_models(const PointPairs& pairs, const std::vector<EightPairs>& samples,
                       const Normalization& normalization_1, const Normalization& normalization_2,
                       double sigma, WorkerThread* helper) {
  Models models;
  run_both(
      helper,
      [&] {
        models.homography =
            best_homography(pairs, samples, normalization_1, normalization_2, sigma);
      },
      [&] {
        models.fundamental =
            best_fundamental(pairs, samples, normalization_1, normalization_2, sigma);
      });
  return models;
}

std::vector<MotionSupport> check_motions(const std::vector<Motion>& motions,
                                         const PointPairs& pairs,
                                         const std::vector<std::uint8_t>& inliers,
                                         const Camera& camera, double sigma, WorkerThread* helper) {
  std::vector<MotionSupport> supports(motions.size());
  const auto check_every_second = [&](std::size_t first) {
    for (std::size_t i = first; i < motions.size(); i += 2) {
      supports[i] = check_motion(motions[i], pairs, inliers, camera, max_chi2 * sigma * sigma);
    }
  };
  run_both(
      helper, [&] { check_every_second(0); }, [&] { check_every_second(1); });
  return supports;
}

/// From one entry per match to one per initial keypoint.
template <class Item>
std::vector<Item> spread(const std::vector<Item>& per_match, const std::vector<int>& matches,
                         const Item& missing) {
  std::vector<Item> result(matches.size(), missing);
  if (per_match.empty()) return result;
  std::size_t k = 0;
  for (std::size_t i = 0; i < matches.size(); ++i) {
    if (matches[i] >= 0) result[i] = per_match[k++];
  }
  return result;
}

void report_models(const Models& models, const std::vector<int>& matches, TwoViewResult& result) {
  result.homography_score = models.homography.score;
  result.fundamental_score = models.fundamental.score;
  result.H_21 = models.homography.matrix;
  result.F_21 = models.fundamental.matrix;
  result.n_homography_inliers = models.homography.n_inliers;
  result.n_fundamental_inliers = models.fundamental.n_inliers;
  result.homography_inlier = spread<std::uint8_t>(models.homography.inliers, matches, 0);
  result.fundamental_inlier = spread<std::uint8_t>(models.fundamental.inliers, matches, 0);
}

TwoViewMotion placed(const Motion& motion, const MotionSupport& support,
                     const std::vector<int>& matches) {
  return {Pose(motion.R, motion.t), support.parallax,
          spread<Eigen::Vector3d>(support.points, matches, Eigen::Vector3d::Zero()),
          spread<std::uint8_t>(support.triangulated, matches, 0)};
}

std::vector<TwoViewMotion> alternatives(const std::vector<Motion>& motions,
                                        const std::vector<MotionSupport>& supports,
                                        std::size_t best, const TwoViewInput& input) {
  std::vector<TwoViewMotion> found;
  const double least = alternative_share * static_cast<double>(supports[best].n_good);
  for (std::size_t i = 0; i < motions.size(); ++i) {
    const MotionSupport& support = supports[i];
    if (static_cast<double>(support.n_good) < least) continue;
    found.push_back(placed(motions[i], support, input.matches));
  }
  return found;
}

/// Chooses among the motions of the chosen model and completes the result.
void recover_motion(const Models& models, const PointPairs& pairs, const TwoViewInput& input,
                    const TwoViewOptions& options, WorkerThread* helper, TwoViewResult& result) {
  const Eigen::Matrix3d K = calibration_of(input.camera);
  const bool planar = result.model == TwoViewModel::homography;
  const ScoredModel& model = planar ? models.homography : models.fundamental;
  const std::vector<Motion> motions =
      planar ? motions_from_homography(model.matrix, K) : motions_from_fundamental(model.matrix, K);
  if (motions.empty()) {
    result.outcome = TwoViewOutcome::degenerate_plane;
    return;
  }
  const std::vector<MotionSupport> supports =
      check_motions(motions, pairs, model.inliers, input.camera, options.sigma, helper);
  for (const MotionSupport& support : supports) {
    result.hypotheses.push_back({support.n_good, support.parallax});
  }
  const MotionChoice choice =
      planar ? choose_homography_motion(result.hypotheses, model.n_inliers, options.limits)
             : choose_fundamental_motion(result.hypotheses, model.n_inliers, options.limits);
  result.outcome = choice.outcome;
  result.best_hypothesis = choice.index;
  const MotionSupport& best = supports[choice.index];
  result.parallax = best.parallax;
  if (result.outcome == TwoViewOutcome::ambiguous_motion) {
    result.alternatives = alternatives(motions, supports, choice.index, input);
  }
  if (!result.success()) return;
  result.T_21 = Pose(motions[choice.index].R, motions[choice.index].t);
  result.points = spread<Eigen::Vector3d>(best.points, input.matches, Eigen::Vector3d::Zero());
  result.triangulated = spread<std::uint8_t>(best.triangulated, input.matches, 0);
}

/// `draw` gives the samples when the number of matches is known to suffice.
template <class Draw>
TwoViewResult reconstruct(const TwoViewInput& input, const TwoViewOptions& options,
                          WorkerThread* helper, Draw draw) {
  check_options(options);
  PointPairs pairs = gather_pairs(input.initial, input.current, input.matches);
  add_homogeneous_points(input.camera, pairs);
  TwoViewResult result;
  result.n_matches = pairs.size();
  result.points.assign(input.matches.size(), Eigen::Vector3d::Zero());
  for (auto* flags :
       {&result.triangulated, &result.homography_inlier, &result.fundamental_inlier}) {
    flags->assign(input.matches.size(), 0);
  }
  if (pairs.size() < options.min_matches) return result;

  Normalization normalization_1, normalization_2;
  if (!normalize(input.initial, normalization_1) || !normalize(input.current, normalization_2)) {
    result.outcome = TwoViewOutcome::degenerate_points;
    return result;
  }
  const Models models = estimate_models(pairs, draw(pairs.size()), normalization_1, normalization_2,
                                        options.sigma, helper);
  report_models(models, input.matches, result);
  const double sum = result.homography_score + result.fundamental_score;
  if (!(sum > 0)) {
    result.outcome = TwoViewOutcome::no_model;
    return result;
  }
  result.homography_ratio = result.homography_score / sum;
  result.model = result.homography_ratio > homography_threshold ? TwoViewModel::homography
                                                                : TwoViewModel::fundamental;
  recover_motion(models, pairs, input, options, helper, result);
  // If a plane fills much of the view, the homography wins. It leaves two motions, although the
  // matches beside the plane would decide between them.
  const auto least = general_scene * static_cast<double>(models.homography.n_inliers);
  if (result.outcome == TwoViewOutcome::ambiguous_motion &&
      result.model == TwoViewModel::homography &&
      static_cast<double>(models.fundamental.n_inliers) >= least) {
    TwoViewResult second = result;
    second.model = TwoViewModel::fundamental;
    second.hypotheses.clear();
    second.alternatives.clear();
    recover_motion(models, pairs, input, options, helper, second);
    if (second.success()) return second;
  }
  return result;
}

}  // namespace

std::vector<EightPairs> draw_samples(std::size_t n_matches, int n_samples, std::uint64_t seed) {
  MinimalSampler sampler(n_matches, seed);
  std::vector<EightPairs> samples;
  for (int i = 0; i < n_samples; ++i) samples.push_back(sampler.draw<sample_size>());
  return samples;
}

TwoViewResult reconstruct_two_views(const TwoViewInput& input, const TwoViewOptions& options,
                                    std::uint64_t seed, WorkerThread* helper) {
  return reconstruct(input, options, helper, [&](std::size_t n_matches) {
    return draw_samples(n_matches, options.n_samples, seed);
  });
}

TwoViewResult reconstruct_two_views(const TwoViewInput& input, const TwoViewOptions& options,
                                    const std::vector<EightPairs>& samples, WorkerThread* helper) {
  return reconstruct(input, options, helper, [&](std::size_t n_matches) {
    check_samples(samples, n_matches);
    return samples;
  });
}

TwoViewMotion place_points(const TwoViewInput& input, const Pose& T_21, double sigma) {
  const double length = T_21.translation().norm();
  if (!(length > 0)) {
    throw std::invalid_argument("a motion without a translation places no points");
  }
  const PointPairs pairs = gather_pairs(input.initial, input.current, input.matches);
  const Motion motion{T_21.rotation().toRotationMatrix(), T_21.translation() / length};
  const std::vector<std::uint8_t> all(pairs.size(), 1);
  const MotionSupport support =
      check_motion(motion, pairs, all, input.camera, max_chi2 * sigma * sigma);
  return placed(motion, support, input.matches);
}

}  // namespace orbslam
