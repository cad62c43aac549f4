// SPDX-License-Identifier: BSD-3-Clause
//
// The whole system on a made-up sequence that closes a loop, each step after the one before: two
// runs give the same bytes, so do two kinds of processors, and other libraries the same path within
// their rounding. Writes what it found, or compares with what another build has written. Exit code
// 1 when the path is wrong or another one.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "driver/back_end.hpp"
#include "driver/images.hpp"
#include "driver/tracker.hpp"
#include "map/content_hash.hpp"
#include "map/trajectory.hpp"

namespace {

using namespace orbslam;
using namespace orbslam::driver;

constexpr int kFramesPerLap = 72;
constexpr int kFrames = 100;  // a lap, and enough of the next one to close the loop
constexpr std::uint64_t kSeed = 1;
/// Metres off the true path, a circle of 0.8 m radius: depths are up to 1 % wrong, images coarse.
constexpr double kWrong = 0.3;

[[noreturn]] void fail(const std::string& message) {
  std::fprintf(stderr, "%s\n", message.c_str());
  std::exit(EXIT_FAILURE);
}

/// A line of the file: what it is, and its numbers.
struct Line {
  std::string name;
  std::vector<double> numbers;
};
using Results = std::vector<Line>;

/// The tracker and the back end, each step waited for: as in the deterministic mode.
class OrderedSystem {
 public:
  OrderedSystem()
      : mapping_(map_, index_, counts_),
        adjustment_(map_, mapping_, counts_, 1),
        loop_closing_(map_, index_, mapping_, adjustment_, counts_, kFramesPerLap, kSeed),
        tracker_(map_, index_, mapping_, counts_) {
    mapping_.on_done = [this](KeyFrameId keyframe) { loop_closing_.worker.submit(keyframe); };
    for (Worker* worker : workers()) worker->start();
  }
  ~OrderedSystem() {
    for (Worker* worker : workers()) worker->finish(false);
  }
  OrderedSystem(const OrderedSystem&) = delete;
  OrderedSystem& operator=(const OrderedSystem&) = delete;

  /// T_wc as it is known at once.
  Pose track(std::shared_ptr<Frame> image) {
    const FrameId id = image->id;
    if (tracker_.track(std::move(image)) != Tracked::ok) {
      fail("frame " + std::to_string(id) + " was lost");
    }
    const Pose T_wc = tracker_.last()->T_cw->inverse();
    recorder_.record(map_, *tracker_.last(), false);
    mapping_.start();
    // Each gives work to the next one only.
    for (Worker* worker : workers()) worker->wait_until_idle();
    return T_wc;
  }

  Trajectory trajectory() const { return recorder_.rebuild(map_); }
  const Map& map() const { return map_; }
  const Counts& counts() const { return counts_; }

 private:
  std::vector<Worker*> workers() {
    return {&mapping_.worker, &loop_closing_.worker, &adjustment_.worker};
  }

  Counts counts_;
  Map map_;
  KeyFrameIndex index_;
  LocalMapping mapping_;
  FullAdjustment adjustment_;
  LoopClosing loop_closing_;
  Tracker tracker_;
  TrajectoryRecorder recorder_;
};

/// Hashes do not fit into a double.
void add_hash(Results& results, const std::string& name, std::uint64_t hash) {
  results.push_back(
      {name, {static_cast<double>(hash >> 32), static_cast<double>(hash & 0xffffffffU)}});
}

void add_pose(Results& results, const std::string& name, const Matrix4& T_wc) {
  results.push_back({name, {T_wc.begin(), T_wc.end()}});
}

/// Ends the program when the path is far from the true one.
void check_path(const Trajectory& path) {
  double worst = 0;
  for (std::size_t i = 0; i < path.frames.size(); ++i) {
    const Pose truth = ImageRing::T_wc(0, kFramesPerLap).inverse() *
                       ImageRing::T_wc(path.frames[i], kFramesPerLap);
    const Eigen::Vector3d found(path.T_wc[i][3], path.T_wc[i][7], path.T_wc[i][11]);
    worst = std::max(worst, (found - truth.translation()).norm());
  }
  std::printf("%zu images, at most %.4f m off the true path\n", path.frames.size(), worst);
  if (!(worst < kWrong)) fail("the path is wrong");
}

Results run() {
  ImageRing images(kFramesPerLap, kSeed);
  OrderedSystem system;
  Results results;
  add_hash(results, "grey images", images.grey_hash());
  add_hash(results, "depth images", images.depth_hash());
  add_hash(results, "features", images.feature_hash());
  for (int i = 0; i < kFrames; ++i) {
    const double turns = static_cast<double>(i) / kFramesPerLap;
    const double drift = 1 + 0.01 * std::sin(4.6 * turns);  // of the sensor; not by laps
    const auto image = images.frame(i, static_cast<FrameId>(i), i / 30.0, drift);
    add_pose(results, "tracked " + std::to_string(i), row_major(system.track(image)));
  }
  check_map(system.map(), "at the end");
  const Trajectory path = system.trajectory();
  for (std::size_t i = 0; i < path.frames.size(); ++i) {
    add_pose(results, "path " + std::to_string(path.frames[i]), path.T_wc[i]);
  }
  const int n_loops = system.counts().loops_closed;
  const int n_adjustments = system.counts().adjustments_committed;
  std::printf("%d keyframes, %d loops closed, %d full adjustments\n",
              system.counts().keyframes.load(), n_loops, n_adjustments);
  results.push_back({"counts",
                     {static_cast<double>(system.counts().keyframes), static_cast<double>(n_loops),
                      static_cast<double>(n_adjustments)}});
  add_hash(results, "map", content_hash(system.map()));
  check_path(path);
  if (n_loops == 0 || n_adjustments == 0) fail("no loop was closed, or none adjusted");
  return results;
}

// ---- files --------------------------------------------------------------------------------------
void write(const Results& results, const std::string& file) {
  std::ofstream out(file);
  for (const Line& line : results) {
    out << line.name << ":";
    for (const double number : line.numbers) {
      char text[32];
      std::snprintf(text, sizeof(text), " %a", number);
      out << text;
    }
    out << "\n";
  }
  out.close();
  if (!out) fail("could not write " + file);
}

Results read(const std::string& file) {
  std::ifstream in(file);
  if (!in) fail("could not read " + file);
  Results results;
  for (std::string text; std::getline(in, text);) {
    const std::size_t colon = text.find(':');
    if (colon == std::string::npos) fail(file + " was not written by this program");
    Line line{text.substr(0, colon), {}};
    const char* at = text.c_str() + colon + 1;
    for (char* end = nullptr;; at = end) {
      const double number = std::strtod(at, &end);
      if (end == at) break;
      line.numbers.push_back(number);
    }
    results.push_back(line);
  }
  return results;
}

/// The first difference must come behind the line `same_through` (unless that is empty), and
/// numbers must be near, hashes are only named; without a tolerance no difference is allowed.
bool near(const Results& ours, const Results& others, const std::string& same_through,
          double tolerance) {
  bool must_be_same = !same_through.empty();
  if (ours.size() != others.size()) fail("another number of lines");
  double worst = 0;
  std::string first, worst_at;
  for (std::size_t i = 0; i < ours.size(); ++i) {
    const Line &a = ours[i], &b = others[i];
    if (a.name != b.name || a.numbers.size() != b.numbers.size()) {
      fail("\"" + a.name + "\" here is \"" + b.name + "\" there");
    }
    if (a.numbers != b.numbers && must_be_same) fail("other bytes: " + a.name);
    if (a.name == same_through) must_be_same = false;
    if (a.numbers == b.numbers) continue;
    if (first.empty()) first = a.name;
    if (a.numbers.size() == 2) continue;  // a hash
    for (std::size_t k = 0; k < a.numbers.size(); ++k) {
      const double apart = std::abs(a.numbers[k] - b.numbers[k]);
      if (apart > worst || std::isnan(apart)) worst = apart, worst_at = a.name;
    }
  }
  if (first.empty()) {
    std::printf("the same bytes\n");
    return true;
  }
  std::printf("first difference: %s; poses at most %.1e apart (%s)\n", first.c_str(), worst,
              worst_at.c_str());
  return tolerance > 0 && worst <= tolerance;
}

}  // namespace

int main(int argc, char** argv) {
  std::string to_write, to_compare, same_through;
  double tolerance = 0;
  for (int i = 1; i < argc; i += 2) {
    const std::string option = argv[i];
    const char* value = i + 1 < argc ? argv[i + 1] : nullptr;
    if (value && option == "--write") {
      to_write = value;
    } else if (value && option == "--compare") {
      to_compare = value;
    } else if (value && option == "--same-through") {
      same_through = value;
    } else if (value && option == "--tolerance") {
      tolerance = std::strtod(value, nullptr);
    } else {
      std::fprintf(stderr,
                   "usage: sequence_driver [--write FILE]\n"
                   "  [--compare FILE [--same-through LINE] [--tolerance METRES]]\n");
      return 2;
    }
  }
  const Results results = run();
  if (!to_write.empty()) write(results, to_write);
  if (to_compare.empty() || near(results, read(to_compare), same_through, tolerance)) {
    return EXIT_SUCCESS;
  }
  fail("The results are further apart from those of " + to_compare + " than allowed.");
}
