// SPDX-License-Identifier: BSD-3-Clause
#include "driver/back_end.hpp"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <iterator>
#include <utility>

#include "loops/loop_choice.hpp"
#include "loops/loop_correction.hpp"
#include "loops/map_merge.hpp"
#include "map/culling.hpp"
#include "map/invariants.hpp"
#include "map/keyframe_insertion.hpp"
#include "matching/for_triangulation.hpp"
#include "matching/fuse.hpp"
#include "optimize/full_bundle_adjustment.hpp"
#include "optimize/local_bundle_adjustment.hpp"
#include "places/place_recognition.hpp"

namespace orbslam::driver {
namespace {

constexpr int kGap = 10;  // keyframes after a loop that are not searched
constexpr int kSureMatches = 80;
constexpr int kAdjustmentThreads = 2;

/// Protects a keyframe while it is looked at; false when it is dead already.
class Lease {
 public:
  Lease(Map& map, KeyFrameIndex& index, KeyFrameId id) : map_(map), index_(index), id_(id) {
    const auto lock = map_.write_lock();
    alive_ = map_.find(id_) != nullptr;
    if (alive_) map_.begin_lease(id_);
  }
  ~Lease() {
    if (!alive_) return;
    bool died;
    {
      const auto lock = map_.write_lock();
      died = map_.end_lease(id_);
    }
    if (died) index_.erase(id_);
  }
  Lease(const Lease&) = delete;
  Lease& operator=(const Lease&) = delete;
  bool alive() const { return alive_; }

 private:
  Map& map_;
  KeyFrameIndex& index_;
  const KeyFrameId id_;
  bool alive_;
};

}  // namespace

void check_map(const Map& map, const char* when) {
  const auto violations = check_invariants(map, true);
  if (violations.empty()) return;
  for (const auto& violation : violations) {
    std::fprintf(stderr, "%s: %s\n", when, violation.c_str());
  }
  std::abort();
}

// ---- local mapping ------------------------------------------------------------------------------
LocalMapping::LocalMapping(Map& map, KeyFrameIndex& index, Counts& counts)
    : worker("local mapping", [this](KeyFrameId id) { process(id); }),
      map_(map),
      index_(index),
      counts_(counts) {}

void LocalMapping::start() {
  for (const KeyFrameId keyframe : inserted_) worker.submit(keyframe);
  inserted_.clear();
}

void LocalMapping::reset() {
  worker.reset();
  inserted_.clear();
  recent_.clear();
  if (inertial_) inertial_->clear();
  sampled_until_ = 0;
}

void LocalMapping::use_imu() {
  inertial_ = std::make_unique<InertialKeyframes>(Pose(), ImuNoise{1e2, 1e3, 1, 10});
}

void LocalMapping::add_inertial(KeyFrameId keyframe, double timestamp) {
  if (!inertial_) return;
  constexpr double kStep = 0.02;
  std::vector<ImuSample> samples;
  double t = sampled_until_;
  for (; t < timestamp + kStep; t += kStep) samples.push_back({t, {0, 0, 0}, {0, 0, 9.81}});
  sampled_until_ = t;
  inertial_->add_samples(samples);
  inertial_->set(keyframe, Eigen::Vector3d::Zero(), {});
}

void LocalMapping::process(KeyFrameId keyframe) {
  ++counts_.keyframes;
  process_new_keyframe(map_, keyframe, recent_);
  cull_recent_points(map_, keyframe, 3, recent_);
  const auto created =
      create_new_points(map_, keyframe, NewPointOptions{}, &worker.waiting_flag.value());
  recent_.insert(recent_.end(), created.begin(), created.end());
  if (worker.n_waiting() == 0) fuse_with_neighbours(map_, keyframe, 10);
  if (worker.lower_interrupt()) {
    local_bundle_adjustment(map_, keyframe, &worker.interrupt_flag.value(), false,
                            kAdjustmentThreads, BundleOptions().solver, inertial_.get());
    const auto is_needed = [&](KeyFrameId id) {
      return inertial_ && inertial_->is_needed(map_, id);
    };
    for (const KeyFrameId dead : cull_keyframes(map_, keyframe, true, is_needed)) {
      index_.erase(dead);
    }
  }
  on_done(keyframe);
}

// ---- full bundle adjustment ---------------------------------------------------------------------
FullAdjustment::FullAdjustment(Map& map, LocalMapping& mapping, Counts& counts, int n_threads)
    : worker("full adjustment", [this](KeyFrameId) { process(); }),
      map_(map),
      mapping_(mapping),
      counts_(counts),
      n_threads_(n_threads) {}

void FullAdjustment::start() {
  cancel();
  worker.submit(KeyFrameId(0));
}

void FullAdjustment::process() {
  ++counts_.adjustments_begun;
  const std::atomic<bool>& cancelled = worker.cancel_flag.value();
  std::optional<Worker::OffDuty> off_duty(worker);
  GatheredBundle bundle = gather_full_bundle(map_);
  const BundleSummary summary =
      solve_full_bundle(bundle, FullBundleOptions{}, &cancelled, n_threads_);
  off_duty.reset();
  bool committed = false;
  if (!summary.aborted && !cancelled) {
    Worker::Pause pause(mapping_.worker, true);
    pause.wait();
    committed = commit_full_bundle(map_, bundle).committed;
  }
  ++(committed ? counts_.adjustments_committed : counts_.adjustments_dropped);
}

// ---- loop closing -------------------------------------------------------------------------------
LoopClosing::LoopClosing(Map& map, KeyFrameIndex& index, LocalMapping& mapping,
                         FullAdjustment& adjustment, Counts& counts, int frames_per_lap,
                         std::uint64_t seed)
    : worker("loop closing", [this](KeyFrameId id) { process(id); }),
      map_(map),
      index_(index),
      mapping_(mapping),
      adjustment_(adjustment),
      counts_(counts),
      frames_per_lap_(frames_per_lap) {
  options_.fix_scale = true;
  options_.seed = seed;
}

void LoopClosing::reset() {
  worker.reset();
  consistency_.clear();
  next_search_ = 1;
  members_.clear();
}

void LoopClosing::process(KeyFrameId keyframe) {
  const Lease lease(map_, index_, keyframe);
  if (!lease.alive()) return;
  const std::optional<Loop> loop = find_loop(keyframe);
  members_.push_back(keyframe);
  if (!loop) return;
  if (joins_maps(*loop)) {
    join(*loop);
  } else {
    close(*loop);
  }
}

bool LoopClosing::joins_maps(const Loop& loop) const {
  const auto lock = map_.read_lock();
  return map_.map_of(loop.current) != map_.map_of(loop.matched);
}

std::optional<Loop> LoopClosing::find_loop(KeyFrameId keyframe) {
  std::vector<KeyFrameId> candidates;
  if (keyframe.value < next_search_) {
    consistency_.clear();
  } else {
    const double least_score = lowest_neighbour_score(map_, keyframe);
    std::vector<KeyFrameId> proposed;
    for (const PlaceCandidate& place : find_loop_candidates(index_, map_, keyframe, least_score)) {
      proposed.push_back(place.keyframe);
    }
    candidates = consistency_.update(map_, proposed);
    if (candidates.empty()) candidates = a_lap_before(keyframe);
    // What looks like a place of another map is tried at once, so that many maps meet.
    const auto lock = map_.read_lock();
    for (const KeyFrameId other : proposed) {
      if (map_.map_of(other) != map_.map_of(keyframe)) candidates.push_back(other);
    }
  }
  index_keyframe(index_, map_, keyframe);

  std::vector<Loop> loops;
  for (const KeyFrameId candidate : candidates) {
    if (worker.cancel_flag.is_set()) return std::nullopt;
    auto loop = verify_loop_candidate(map_, keyframe, candidate, options_);
    if (loop) loops.push_back(std::move(*loop));
  }
  counts_.verified += static_cast<int>(loops.size());
  return choose(std::move(loops));
}

std::optional<Loop> LoopClosing::choose(std::vector<Loop> loops) const {
  std::vector<Loop> elsewhere;
  const auto first = std::stable_partition(loops.begin(), loops.end(),
                                           [this](const Loop& loop) { return !joins_maps(loop); });
  std::move(first, loops.end(), std::back_inserter(elsewhere));
  loops.erase(first, loops.end());
  if (auto chosen = choose_loop(map_, loops, options_.fix_scale)) return chosen;
  if (auto chosen = choose_merge(map_, elsewhere, options_.fix_scale)) return chosen;
  // A hurried map of coarse images drifts by more than is believed of a map. Here every view shows
  // another place, so that what was verified is true.
  for (Loop& loop : loops) {
    if (loop.n_matches >= kSureMatches) return std::move(loop);
  }
  return std::nullopt;
}

std::vector<KeyFrameId> LoopClosing::a_lap_before(KeyFrameId keyframe) const {
  const auto lock = map_.read_lock();
  const KeyFrame* current = map_.find(keyframe);
  if (!current) return {};
  for (const KeyFrameId id : members_) {
    const KeyFrame* other = map_.find(id);
    if (!other || map_.weight(keyframe, id) > 0) continue;
    const auto apart = current->frame->id - other->frame->id;
    const auto views = apart % frames_per_lap_;
    if (apart > frames_per_lap_ / 2 && (views <= 2 || views >= frames_per_lap_ - 2)) return {id};
  }
  return {};
}

void LoopClosing::close(const Loop& loop) {
  adjustment_.cancel();  // what it refines is about to move
  LoopCorrectionResult result;
  {
    // Nobody else moves the map as a whole while the correction is worked out.
    const Worker::Pause no_adjustment(adjustment_.worker, true);
    Worker::Pause pause(mapping_.worker, true);
    pause.wait();
    {
      const auto lock = map_.write_lock();
      map_.update_connections(loop.current);
    }
    LoopCorrection correction = plan_loop_correction(map_, loop, options_.fix_scale);
    if (!optimize_essential_graph(correction, &worker.cancel_flag.value()).aborted) {
      result = apply_loop_correction(map_, correction);
    }
    if (result.applied) check_map(map_, "after a loop");
  }
  if (!result.applied) {
    ++counts_.corrections_dropped;
    return;
  }
  ++counts_.loops_closed;
  consistency_.clear();
  next_search_ = loop.current.value + kGap;
  adjustment_.start();
}

void LoopClosing::join(const Loop& loop) {
  adjustment_.cancel();
  MapMergeResult result;
  {
    const Worker::Pause no_adjustment(adjustment_.worker, true);
    Worker::Pause pause(mapping_.worker, true);
    pause.wait();
    {
      const auto lock = map_.write_lock();
      if (!map_.find(loop.current)) return;
      map_.update_connections(loop.current);
    }
    result = apply_map_merge(map_, plan_map_merge(map_, loop, options_.fix_scale));
    if (!result.applied) return;
    check_map(map_, "after a merge");
    const std::atomic<bool>& cancelled = worker.cancel_flag.value();
    const KeyFramePoses before = poses_of_map(map_, result.kept);
    const std::vector<KeyFrameId> seam = keyframes_of_seam(map_, loop.current);
    local_bundle_adjustment(map_, loop.current, &cancelled);
    spread_from_seam(map_, before, seam, options_.fix_scale, &cancelled);
    check_map(map_, "after the seam was spread");
  }
  ++counts_.maps_merged;
  consistency_.clear();
  next_search_ = loop.current.value + kGap;
  adjustment_.start();
}

}  // namespace orbslam::driver
