// SPDX-License-Identifier: BSD-3-Clause
#include "loops/loop_verification.hpp"

#include <algorithm>
#include <cstddef>
#include <memory>
#include <utility>
#include <vector>

#include "base/seeds.hpp"
#include "geometry/sim3_ransac.hpp"
#include "matching/by_sim3.hpp"
#include "matching/by_words.hpp"
#include "matching/id_index.hpp"
#include "optimize/sim3_optimization.hpp"

namespace orbslam {
namespace {

constexpr float kWordRatio = 0.75F;
/// In a repetitive image RANSAC may find many wrong similarities. Each costs a guided search;
/// hundreds would take seconds.
constexpr int kMaxRefinements = 10;

/// The far side's point per keypoint of `current`, or an invalid id.
using MatchedPoints = std::vector<MapPointId>;

/// The data of both keyframes about the matched points, copied under one lock.
struct Correspondences {
  std::vector<std::uint32_t> keypoints;  ///< of `current`, ascending
  std::vector<SimilarityMatch> matches;  ///< 1: current, 2: candidate
  std::shared_ptr<const Camera> camera_1, camera_2;
  Pose T_mw;  ///< candidate
};

/// Both points of a keypoint of `current` and its counterpart, if both sides have one.
std::optional<SimilarityMatch> correspondence(const Map& map, const KeyFrame& current,
                                              const KeyFrame& candidate, std::size_t keypoint,
                                              MapPointId partner) {
  const MapPoint* point_1 = map.find(current.map_points[keypoint]);
  const MapPoint* point_2 = map.find(partner);
  if (!point_1 || !point_2) return std::nullopt;
  const Observation* seen = point_2->observation_of(candidate.id);
  if (!seen) return std::nullopt;
  const Frame &frame_1 = *current.frame, &frame_2 = *candidate.frame;
  const Keypoint& at_1 = frame_1.keypoints[keypoint];
  const Keypoint& at_2 = frame_2.keypoints[seen->index];
  SimilarityMatch match;
  match.point_1 = current.T_cw * point_1->position;
  match.point_2 = candidate.T_cw * point_2->position;
  match.pixel_1 = {at_1.x, at_1.y};
  match.pixel_2 = {at_2.x, at_2.y};
  match.inverse_sigma2_1 = frame_1.scales->inverse_sigma2(at_1.level);
  match.inverse_sigma2_2 = frame_2.scales->inverse_sigma2(at_2.level);
  return match;
}

/// A keypoint of `current` and a point of the far side, observed by any keyframe there.
std::optional<SimilarityMatch> sighting(const Map& map, const KeyFrame& current,
                                        const KeyFrame& candidate, std::size_t keypoint,
                                        MapPointId partner) {
  const MapPoint* point_2 = map.find(partner);
  if (!point_2) return std::nullopt;
  const Keypoint& at_1 = current.frame->keypoints[keypoint];
  SimilarityMatch match;
  match.point_2 = candidate.T_cw * point_2->position;
  match.pixel_1 = {at_1.x, at_1.y};
  match.inverse_sigma2_1 = current.frame->scales->inverse_sigma2(at_1.level);
  match.mutual = false;
  return match;
}

enum class Gathered { kMutual, kAll };

/// None when a keyframe is dead. Matches that lack a point on either side are deleted, unless all
/// are gathered: alone they cannot be verified.
std::optional<Correspondences> gather(const Map& map, KeyFrameId current, KeyFrameId candidate,
                                      MatchedPoints& matched, Gathered which = Gathered::kMutual) {
  const auto lock = map.read_lock();
  const KeyFrame* keyframe_1 = map.find(current);
  const KeyFrame* keyframe_2 = map.find(candidate);
  if (!keyframe_1 || !keyframe_2) return std::nullopt;
  Correspondences gathered;
  gathered.camera_1 = keyframe_1->frame->camera;
  gathered.camera_2 = keyframe_2->frame->camera;
  gathered.T_mw = keyframe_2->T_cw;
  for (std::size_t i = 0; i < matched.size(); ++i) {
    if (!matched[i].valid()) continue;
    auto match = correspondence(map, *keyframe_1, *keyframe_2, i, matched[i]);
    if (!match && which == Gathered::kAll) {
      match = sighting(map, *keyframe_1, *keyframe_2, i, matched[i]);
    }
    if (match) {
      gathered.keypoints.push_back(static_cast<std::uint32_t>(i));
      gathered.matches.push_back(*match);
    } else {
      matched[i] = MapPointId();
    }
  }
  return gathered;
}

/// Features paired by words, as points of the candidate. Empty when a keyframe is dead.
MatchedPoints match_words(const Map& map, KeyFrameId current, KeyFrameId candidate) {
  const auto pairs = match_keyframes_by_words(map, current, candidate, kWordRatio);
  const auto lock = map.read_lock();
  const KeyFrame* keyframe_1 = map.find(current);
  const KeyFrame* keyframe_2 = map.find(candidate);
  if (!keyframe_1 || !keyframe_2) return {};
  MatchedPoints matched(keyframe_1->frame->size());
  for (const auto& [i, j] : pairs) matched[i] = keyframe_2->map_points[j];
  return matched;
}

Sim3Problem to_problem(const Correspondences& gathered) {
  const auto n = static_cast<Eigen::Index>(gathered.matches.size());
  Sim3Problem problem;
  problem.points_1.resize(3, n);
  problem.points_2.resize(3, n);
  problem.sigma2_1.resize(n);
  problem.sigma2_2.resize(n);
  problem.camera_1 = gathered.camera_1;
  problem.camera_2 = gathered.camera_2;
  for (Eigen::Index k = 0; k < n; ++k) {
    const SimilarityMatch& match = gathered.matches[static_cast<std::size_t>(k)];
    problem.points_1.col(k) = match.point_1;
    problem.points_2.col(k) = match.point_2;
    problem.sigma2_1[k] = 1 / match.inverse_sigma2_1;
    problem.sigma2_2[k] = 1 / match.inverse_sigma2_2;
  }
  return problem;
}

/// All points that the candidate and its neighbours observe, each once.
std::vector<MapPointId> points_around(const Map& map, KeyFrameId candidate) {
  std::vector<MapPointId> points;
  const auto lock = map.read_lock();
  const KeyFrame* center = map.find(candidate);
  if (!center) return points;
  std::vector<KeyFrameId> around = center->neighbours;
  around.push_back(candidate);
  thread_local PointIdIndex listed;
  listed.reset(center->map_points.size());
  for (const KeyFrameId id : around) {
    const KeyFrame* keyframe = map.find(id);
    if (!keyframe) continue;
    for (const MapPointId point : keyframe->map_points) {
      if (map.find(point) && listed.insert(point, 0)) points.push_back(point);
    }
  }
  return points;
}

/// The constant data of the verification of one candidate.
class Verification {
 public:
  Verification(const Map& map, KeyFrameId current, KeyFrameId candidate,
               const LoopVerificationOptions& options)
      : map_(map), current_(current), candidate_(candidate), options_(options) {}

  std::optional<Loop> run() const {
    MatchedPoints by_words = match_words(map_, current_, candidate_);
    const auto gathered = gather(map_, current_, candidate_, by_words);
    if (!gathered || too_few(gathered->matches.size(), options_.min_word_matches)) return {};
    std::optional<Loop> loop = find_similarity(*gathered, by_words);
    if (!loop) return {};
    loop->loop_points = points_around(map_, candidate_);
    match_around(*loop);
    if (loop->n_matches < options_.min_matches) return {};
    settle(*loop);
    return loop;
  }

 private:
  static bool too_few(std::size_t n, int minimum) {
    return static_cast<std::ptrdiff_t>(n) < static_cast<std::ptrdiff_t>(minimum);
  }

  std::optional<Loop> find_similarity(const Correspondences& gathered,
                                      const MatchedPoints& by_words) const {
    Sim3Options ransac_options;
    ransac_options.fix_scale = options_.fix_scale;
    ransac_options.ransac.min_inliers = static_cast<std::size_t>(std::max(options_.min_inliers, 0));
    const std::uint64_t seed = seed_of({options_.seed, static_cast<std::uint64_t>(current_.value),
                                        static_cast<std::uint64_t>(candidate_.value)});
    Sim3Ransac ransac(to_problem(gathered), ransac_options, seed);
    for (int trial = 0; trial < kMaxRefinements; ++trial) {
      const auto estimate = ransac.iterate(ransac.max_iterations());
      if (!estimate) return {};
      MatchedPoints matched(by_words.size());
      for (std::size_t k = 0; k < gathered.keypoints.size(); ++k) {
        const std::uint32_t i = gathered.keypoints[k];
        if (estimate->inliers[k]) matched[i] = by_words[i];
      }
      if (auto loop = refine(estimate->S_12, std::move(matched))) return loop;
    }
    return {};
  }

  std::optional<Loop> refine(const Similarity& S_cm, MatchedPoints matched) const {
    match_by_similarity(map_, current_, candidate_, S_cm, matched);
    const auto gathered = gather(map_, current_, candidate_, matched);
    if (!gathered) return {};
    const SimilarityEstimate refined = optimize(S_cm, *gathered);
    if (refined.n_inliers == 0 || refined.n_inliers < options_.min_inliers) return {};
    drop_outliers(refined, *gathered, matched);
    Loop loop;
    loop.current = current_;
    loop.matched = candidate_;
    loop.S_cm = refined.S_12;
    loop.S_cw = refined.S_12 * Similarity(gathered->T_mw);
    loop.matches = std::move(matched);
    loop.n_inliers = refined.n_inliers;
    return loop;
  }

  /// Matches the points around the candidate as well.
  void match_around(Loop& loop) const {
    match_loop_points(map_, current_, loop.S_cw, loop.loop_points, loop.matches);
    loop.n_matches = static_cast<int>(std::count_if(
        loop.matches.begin(), loop.matches.end(), [](MapPointId point) { return point.valid(); }));
  }

  /// Refines once more with all matches. The points of the neighbours surround the few that the two
  /// keyframes share, and determine the similarity better.
  void settle(Loop& loop) const {
    const auto gathered = gather(map_, current_, candidate_, loop.matches, Gathered::kAll);
    if (!gathered) return;
    const SimilarityEstimate refined = optimize(loop.S_cm, *gathered);
    const int n_mutual = count_mutual(refined, *gathered);
    if (refined.n_inliers < options_.min_matches || n_mutual < options_.min_inliers) return;
    drop_outliers(refined, *gathered, loop.matches);
    loop.n_inliers = n_mutual;
    loop.S_cm = refined.S_12;
    loop.S_cw = refined.S_12 * Similarity(gathered->T_mw);
    match_around(loop);
  }

  SimilarityEstimate optimize(const Similarity& S_cm, const Correspondences& gathered) const {
    SimilarityOptions options;
    options.fix_scale = options_.fix_scale;
    return optimize_similarity(S_cm, *gathered.camera_1, *gathered.camera_2, gathered.matches,
                               options);
  }

  /// Inliers with a point in both keyframes: only these determine the scale.
  static int count_mutual(const SimilarityEstimate& estimate, const Correspondences& gathered) {
    int n = 0;
    for (std::size_t k = 0; k < gathered.matches.size(); ++k) {
      n += gathered.matches[k].mutual && !estimate.outlier[k] ? 1 : 0;
    }
    return n;
  }

  static void drop_outliers(const SimilarityEstimate& estimate, const Correspondences& gathered,
                            MatchedPoints& matched) {
    for (std::size_t k = 0; k < gathered.keypoints.size(); ++k) {
      if (estimate.outlier[k]) matched[gathered.keypoints[k]] = MapPointId();
    }
  }

  const Map& map_;
  KeyFrameId current_, candidate_;
  const LoopVerificationOptions& options_;
};

}  // namespace

std::optional<Loop> verify_loop_candidate(const Map& map, KeyFrameId current, KeyFrameId candidate,
                                          const LoopVerificationOptions& options) {
  if (current == candidate) return std::nullopt;
  return Verification(map, current, candidate, options).run();
}

}  // namespace orbslam
