// SPDX-License-Identifier: BSD-3-Clause
#include "loops/loop_choice.hpp"

#include <algorithm>
#include <cmath>
#include <shared_mutex>
#include <stdexcept>

#include "loops/keyframe_graph.hpp"
#include "map/scene_depth.hpp"

namespace orbslam {
namespace {

// Stereo systems drift by less than 2 % of the path, single cameras by up to 10 %. Most of the
// latter is drift of scale, which the loop itself measures.
constexpr double kDriftOfPath = 0.04;  // metres per metre
constexpr double kDriftOfTurn = 0.02;  // scene depths per radian
constexpr double kMeasuring = 0.1;     // scene depths, by which a loop's own measurement may err
constexpr double kHiddenScale = 0.05;  // log of a scale drift that was undone later
constexpr double kRotation = 0.1;      // radians, drift over a short way and measurement
constexpr double kRotationOfTurn = 0.03;
constexpr double kRotationOfPath = 0.01;             // radians per scene depth
constexpr double kMaxRotation = 1.0471975511965976;  // 60 degrees
constexpr double kScaleDrift = 1.5;                  // over a short way
const double kLogScale = std::log(kScaleDrift);
constexpr double kLogScaleOfPath = 0.01;  // per scene depth
/// The error of a difference of two measurements is sqrt(2) times that of one; rounded up.
constexpr double kTwoMeasurements = 1.5;
constexpr double kRounding = 1e-9;

double angle_between(const Pose& a, const Pose& b) {
  const Eigen::Quaterniond turn = a.rotation() * b.rotation().conjugate();
  return 2 * std::atan2(turn.vec().norm(), std::abs(turn.w()));
}

/// 0 for a dead keyframe.
double scene_depth_around(const Map& map, KeyFrameId id) {
  const auto lock = map.read_lock();
  const KeyFrame* keyframe = map.find(id);
  return keyframe ? std::max(0.0, median_scene_depth(map, *keyframe).value_or(0)) : 0.0;
}

struct Limits {
  double translation = 0, rotation = 0, log_scale = 0;
};

/// Largest differences that drift along a path explains, if the scale has changed by
/// exp(log_scale). `measuring` multiplies the error of the measurement.
Limits limits_of(const KeyFrameWay& way, double scene_depth, double log_scale, bool fix_scale,
                 double measuring = 1) {
  Limits limits;
  const double depths = scene_depth > 0 ? way.length / scene_depth : 0;
  limits.translation = kDriftOfPath * way.length + kDriftOfTurn * scene_depth * way.turned +
                       measuring * kMeasuring * scene_depth;
  if (!fix_scale) {
    limits.translation += way.reach * (std::abs(log_scale) + kHiddenScale);
    limits.log_scale = kLogScale + kLogScaleOfPath * depths;
  }
  limits.rotation = std::min(kMaxRotation, measuring * kRotation + kRotationOfTurn * way.turned +
                                               kRotationOfPath * depths);
  return limits;
}

/// The map around the keyframe that loops are judged for, copied.
struct Surroundings {
  Surroundings(const Map& map, KeyFrameId current) : Surroundings(map, current, map.read_lock()) {}

  /// A rotation counts as the number of metres that its drift corresponds to.
  std::vector<KeyFrameWay> ways(KeyFrameId from, const std::vector<KeyFrameId>& to) const {
    return graph.shortest_ways(from, to, scene_depth * kDriftOfTurn / kDriftOfPath);
  }

  KeyFrameGraph graph;
  Pose T_cw;
  double scene_depth = 0;  // 0 for a dead keyframe, which no way leads to

 private:
  using ReadLock = std::shared_lock<std::shared_mutex>;

  Surroundings(const Map& map, KeyFrameId current, const ReadLock& /*held*/) : graph(map) {
    const KeyFrame* keyframe = map.find(current);
    if (!keyframe) return;
    T_cw = keyframe->T_cw;
    scene_depth = std::max(0.0, median_scene_depth(map, *keyframe).value_or(0));
  }
};

LoopDrift assess(const Surroundings& around, const Loop& loop, const KeyFrameWay& way,
                 bool fix_scale) {
  LoopDrift drift;
  drift.path = way.length;
  drift.turned = way.turned;
  drift.reach = way.reach;
  drift.scene_depth = around.scene_depth;
  const Pose corrected = loop.S_cw.pose();
  drift.translation = (corrected.center() - around.T_cw.center()).norm();
  drift.rotation = angle_between(corrected, around.T_cw);
  drift.scale = loop.S_cm.scale();
  if (!way.exists()) return drift;
  const Limits limits = limits_of(way, around.scene_depth, std::log(drift.scale), fix_scale);
  drift.max_translation = limits.translation;
  drift.max_rotation = limits.rotation;
  drift.max_log_scale = limits.log_scale;
  return drift;
}

/// Difference between two measured poses of one camera.
struct Difference {
  Difference(const Pose& a, const Pose& b)
      : translation((a.center() - b.center()).norm()), rotation(angle_between(a, b)) {}

  double translation, rotation;

  bool within(const Limits& limits) const {
    return translation <= limits.translation && rotation <= limits.rotation;
  }
};

/// Most measurements agree closely. The distance between the far ends is only needed for the
/// others.
KeyFrameWay nowhere() {
  KeyFrameWay way;
  way.length = 0;
  return way;
}

bool contradict(const Loop& a, const Loop& b, const Surroundings& around, bool fix_scale) {
  const Difference difference(a.S_cw.pose(), b.S_cw.pose());
  const double log_scale = std::log(a.S_cm.scale() / b.S_cm.scale());
  const auto limits = [&](const KeyFrameWay& way) {
    return limits_of(way, around.scene_depth, log_scale, fix_scale, kTwoMeasurements);
  };
  if (difference.within(limits(nowhere()))) return false;
  return !difference.within(limits(around.ways(a.matched, {b.matched}).front()));
}

bool stronger(const Loop& a, const Loop& b) {
  return a.n_matches != b.n_matches ? a.n_matches > b.n_matches : a.matched < b.matched;
}

}  // namespace

bool LoopDrift::plausible() const {
  return std::isfinite(path) && translation <= max_translation && rotation <= max_rotation &&
         std::abs(std::log(scale)) <= max_log_scale + kRounding;
}

LoopDrift assess_drift(const Map& map, const Loop& loop, bool fix_scale) {
  const Surroundings around(map, loop.current);
  return assess(around, loop, around.ways(loop.current, {loop.matched}).front(), fix_scale);
}

std::optional<Loop> choose_loop(const Map& map, const std::vector<Loop>& loops, bool fix_scale) {
  if (loops.empty()) return std::nullopt;
  std::vector<KeyFrameId> far_ends;
  for (const Loop& loop : loops) {
    if (loop.current != loops.front().current) {
      throw std::invalid_argument("choose_loop: all loops must be of the same keyframe");
    }
    far_ends.push_back(loop.matched);
  }
  const Surroundings around(map, loops.front().current);
  const std::vector<KeyFrameWay> ways = around.ways(loops.front().current, far_ends);
  std::vector<const Loop*> plausible;
  for (std::size_t i = 0; i < loops.size(); ++i) {
    if (assess(around, loops[i], ways[i], fix_scale).plausible()) plausible.push_back(&loops[i]);
  }
  for (std::size_t i = 0; i < plausible.size(); ++i) {
    for (std::size_t j = i + 1; j < plausible.size(); ++j) {
      if (contradict(*plausible[i], *plausible[j], around, fix_scale)) return std::nullopt;
    }
  }
  const auto best = std::min_element(plausible.begin(), plausible.end(),
                                     [](const Loop* a, const Loop* b) { return stronger(*a, *b); });
  if (best == plausible.end()) return std::nullopt;
  return **best;
}

std::optional<Loop> choose_merge(const Map& map, const std::vector<Loop>& loops, bool fix_scale) {
  if (loops.empty()) return std::nullopt;
  {
    const auto lock = map.read_lock();
    const MapIndex other = map.map_of(loops.front().matched);
    for (const Loop& loop : loops) {
      if (map.map_of(loop.matched) != other) return std::nullopt;
    }
  }
  // Positions and lengths are in the other map.
  const Surroundings around(map, loops.front().matched);
  for (std::size_t i = 0; i < loops.size(); ++i) {
    for (std::size_t j = i + 1; j < loops.size(); ++j) {
      if (contradict(loops[i], loops[j], around, fix_scale)) return std::nullopt;
    }
  }
  return *std::min_element(loops.begin(), loops.end(), stronger);
}

bool may_be_one_place(const Map& map, KeyFrameId a, const Pose& T_aw, KeyFrameId b,
                      const Pose& T_bw, bool fix_scale) {
  const Difference difference(T_aw, T_bw);
  const auto explained = [&](const KeyFrameWay& way, double scene_depth) {
    return difference.within(limits_of(way, scene_depth, 0, fix_scale, kTwoMeasurements));
  };
  // The graph of a large map is not copied for poses that agree.
  if (explained(nowhere(), scene_depth_around(map, a))) return true;
  const Surroundings around(map, a);
  return explained(around.ways(a, {b}).front(), around.scene_depth);
}

}  // namespace orbslam
