// SPDX-License-Identifier: BSD-3-Clause
//
// Tracks and maps at once in two threads, with the core's verbs in the order of tracking.py and
// local_mapping.py, while a third thread reads the map as a viewer would. Under the thread
// sanitizer any race in the core ends it with an error. Exit code 1 when tracking or an invariant
// of the map fails.

#include <atomic>
#include <condition_variable>
#include <cstdio>
#include <cstdlib>
#include <deque>
#include <limits>
#include <mutex>
#include <random>
#include <thread>

#include "features/orb_extractor.hpp"
#include "frame/build_frame.hpp"
#include "map/anchor.hpp"
#include "map/culling.hpp"
#include "map/invariants.hpp"
#include "map/keyframe_insertion.hpp"
#include "map/local_map.hpp"
#include "map/sightings.hpp"
#include "matching/by_projection.hpp"
#include "matching/by_words.hpp"
#include "matching/for_triangulation.hpp"
#include "matching/fuse.hpp"
#include "optimize/local_bundle_adjustment.hpp"
#include "optimize/pose_optimization.hpp"
#include "places/vocabulary.hpp"
#include "synthetic/paths.hpp"
#include "synthetic/world.hpp"

namespace {

using namespace orbslam;

/// Two levels of random centres: enough to group features for matching by words.
std::shared_ptr<const Vocabulary> random_vocabulary() {
  std::mt19937_64 random(1);
  const auto descriptor = [&random] {
    Descriptor d;
    for (auto& word : d.words) word = random();
    return d;
  };
  std::vector<VocabularyNode> nodes;
  for (int i = 0; i < 10; ++i) nodes.push_back({0, false, descriptor(), 0});
  for (std::uint32_t parent = 1; parent <= 10; ++parent) {
    for (int i = 0; i < 10; ++i) nodes.push_back({parent, true, descriptor(), 1.0});
  }
  return Vocabulary::from_nodes(10, 2, Scoring::kL1, Weighting::kTfIdf, nodes);
}

/// The mapper of local_mapping.py with a queue of keyframes.
class Mapper {
 public:
  explicit Mapper(Map& map) : map_(map), thread_([this] { run(); }) {}
  ~Mapper() {
    {
      const std::lock_guard lock(mutex_);
      finished_ = true;
      interrupt_ = true;
    }
    wake_.notify_all();
    thread_.join();
  }

  void submit(KeyFrameId keyframe) {
    {
      const std::lock_guard lock(mutex_);
      queue_.push_back(keyframe);
      waiting_ = true;
      interrupt_ = true;
    }
    wake_.notify_all();
  }
  std::size_t n_waiting() const {
    const std::lock_guard lock(mutex_);
    return queue_.size();
  }
  bool idle() const {
    const std::lock_guard lock(mutex_);
    return queue_.empty() && !busy_;
  }

 private:
  void run() {
    for (;;) {
      KeyFrameId keyframe;
      {
        std::unique_lock lock(mutex_);
        busy_ = false;
        wake_.wait(lock, [this] { return finished_ || !queue_.empty(); });
        if (finished_) return;
        keyframe = queue_.front();
        queue_.pop_front();
        busy_ = true;
        waiting_ = !queue_.empty();
        interrupt_ = false;
      }
      process(keyframe);
    }
  }

  void process(KeyFrameId keyframe) {
    process_new_keyframe(map_, keyframe, recent_);
    cull_recent_points(map_, keyframe, 3, recent_);
    const auto created = create_new_points(map_, keyframe, NewPointOptions{}, &waiting_);
    recent_.insert(recent_.end(), created.begin(), created.end());
    if (!waiting_) fuse_with_neighbours(map_, keyframe, 10);
    if (!waiting_) {
      local_bundle_adjustment(map_, keyframe, &interrupt_);
      cull_keyframes(map_, keyframe, true);
    }
  }

  Map& map_;
  std::vector<MapPointId> recent_;
  mutable std::mutex mutex_;
  std::condition_variable wake_;
  std::deque<KeyFrameId> queue_;
  bool finished_ = false, busy_ = false;
  std::atomic<bool> waiting_{false}, interrupt_{false};
  std::thread thread_;
};

/// The tracker of tracking.py for an RGB-D camera.
class Tracker {
 public:
  Tracker(Map& map, Mapper& mapper, std::shared_ptr<const Vocabulary> vocabulary)
      : map_(map), mapper_(mapper), vocabulary_(std::move(vocabulary)) {}

  /// Returns the number of inliers; below 30 tracking is lost.
  int track(std::shared_ptr<Frame> image) {
    describe(*image, *vocabulary_);
    TrackedFrame frame(std::move(image));
    if (!last_) {
      frame.T_cw = Pose();
      insert(frame, std::numeric_limits<std::size_t>::max());
      remember(std::move(frame));
      return std::numeric_limits<int>::max();
    }

    const PointBatch points = follow_map(map_, *last_).points;
    frame.T_cw = velocity_ * *last_->T_cw;
    frame.anchor = last_->anchor;
    int n_matches = match_last_frame(frame, *last_, points, 15, true);
    if (n_matches < 20) {
      frame.T_cw = last_->T_cw;
      n_matches = match_keyframe_by_words(map_, reference_, frame, 0.7F);
    }
    optimize_pose(frame);
    const auto discarded = frame.discard_outliers();

    const LocalMap local = select_local_map(map_, frame);
    if (local.reference_keyframe.valid()) reference_ = local.reference_keyframe;
    const LocalMapMatches matches = match_local_map(frame, local.points, discarded, 3);
    const PoseEstimate estimate = optimize_pose(frame);
    count_sightings(map_, frame, matches.visible);
    velocity_ = *frame.T_cw * last_->T_cw->inverse();

    const int n_reference = count_tracked_points(map_, reference_, 3);
    const bool weak = estimate.n_inliers < 0.75 * n_reference;
    if ((weak || frame.frame->id % 10 == 0) && mapper_.n_waiting() < 3) insert(frame, 100);
    frame.discard_outliers();
    remember(std::move(frame));
    return estimate.n_inliers;
  }

 private:
  void insert(TrackedFrame& frame, std::size_t n_minimum) {
    reference_ = insert_keyframe(map_, frame, true, n_minimum);
    mapper_.submit(reference_);
  }
  void remember(TrackedFrame frame) { last_ = std::move(frame); }

  Map& map_;
  Mapper& mapper_;
  std::shared_ptr<const Vocabulary> vocabulary_;
  std::optional<TrackedFrame> last_;
  Pose velocity_;
  KeyFrameId reference_;
};

/// What a viewer does: looks at everything, all the time.
void read_until(const Map& map, const std::atomic<bool>& done) {
  while (!done) {
    {
      const auto lock = map.read_lock();
      Eigen::Vector3d sum = Eigen::Vector3d::Zero();
      map.for_each_keyframe([&sum](const KeyFrame& keyframe) { sum += keyframe.center(); });
      map.for_each_point([&sum](const MapPoint& point) { sum += point.position; });
      if (!sum.allFinite()) std::abort();
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
}

}  // namespace

int main(int argc, char** argv) {
  const int n_frames = argc > 1 ? std::atoi(argv[1]) : 60;
  const Eigen::Vector3d room(8, 3, 6);
  const synthetic::World world = synthetic::make_room(room, 1, 6);
  synthetic::RenderOptions view;
  view.fx = view.fy = 260;
  view.cx = 160;
  view.cy = 120;
  view.size = {320, 240};
  view.noise = 2;

  OrbOptions orb;
  orb.n_features = 700;
  OrbExtractor extractor(orb);
  CameraOptions camera;
  camera.pinhole = {view.fx, view.fy, view.cx, view.cy};
  camera.bf = 0.08 * view.fx;
  camera.depth_ratio = 40;
  camera.image_size = view.size;
  const FrameContext context{std::make_shared<Camera>(camera),
                             std::make_shared<ScalePyramid>(extractor.scales())};

  Map map;
  int worst = std::numeric_limits<int>::max();
  double error = 0;
  {
    Mapper mapper(map);
    Tracker tracker(map, mapper, random_vocabulary());
    std::atomic<bool> done{false};
    std::thread reader([&map, &done] { read_until(map, done); });
    const Pose T_w0 = synthetic::room_T_wc(room, 0);
    for (int i = 0; i < n_frames; ++i) {
      const Pose T_wc = synthetic::room_T_wc(room, i / 30.0);
      view.noise_seed = static_cast<std::uint64_t>(i);
      const auto image = synthetic::render(world, T_wc.inverse(), view);
      worst = std::min(
          worst, tracker.track(build_rgbd_frame(
                     context, i, i / 30.0, extractor.extract(image.grey).features, image.depth)));
    }
    // Let the mapper work off its queue while the reader still looks.
    while (!mapper.idle()) std::this_thread::sleep_for(std::chrono::milliseconds(10));
    done = true;
    reader.join();

    const auto lock = map.read_lock();
    map.for_each_keyframe([&](const KeyFrame& keyframe) {
      const Pose truth = synthetic::room_T_wc(room, keyframe.frame->timestamp);
      error = std::max(error, (keyframe.center() - (T_w0.inverse() * truth).translation()).norm());
    });
  }

  const auto violations = check_invariants(map, true);
  for (const auto& violation : violations) std::printf("%s\n", violation.c_str());
  std::printf(
      "%d frames, %zu keyframes, %zu points, fewest inliers %d, largest keyframe error %.4f m\n",
      n_frames, map.n_keyframes(), map.n_points(), worst, error);
  // Images of 320 x 240 of walls 3 m away: a pixel is a centimetre.
  return violations.empty() && worst >= 30 && error < 0.15 ? EXIT_SUCCESS : EXIT_FAILURE;
}
