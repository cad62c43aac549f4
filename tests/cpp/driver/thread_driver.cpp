// SPDX-License-Identifier: BSD-3-Clause
//
// The whole system in C++ threads: tracking, mapping, loop closing, full bundle adjustment, with
// the core's verbs in the order of the Python modules, while others switch modes, reset, pause,
// refine, look at the map, shut down and start again, at random. Under the thread sanitizer any
// race in the core ends it with an error. Exit code 1 when an invariant of the map breaks, a
// control operation hangs, or nothing happened.

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "driver/system.hpp"

namespace {

using namespace orbslam;
using namespace orbslam::driver;
using Clock = std::chrono::steady_clock;

constexpr int kFramesPerLap = 72;

struct Options {
  double seconds = 20;
  double patience = 2;  // seconds that a control operation may take
  std::uint64_t seed = 1;
};

Options parse(int argc, char** argv) {
  Options options;
  for (int i = 1; i < argc; i += 2) {
    const char* value = i + 1 < argc ? argv[i + 1] : nullptr;
    char* end = nullptr;
    const double number = value ? std::strtod(value, &end) : -1;
    const bool good = value && end != value && *end == '\0' && number >= 0;
    if (good && std::strcmp(argv[i], "--seconds") == 0) {
      options.seconds = number;
    } else if (good && std::strcmp(argv[i], "--patience") == 0) {
      options.patience = number;
    } else if (good && std::strcmp(argv[i], "--seed") == 0) {
      options.seed = static_cast<std::uint64_t>(number);
    } else {
      std::fprintf(stderr, "usage: thread_driver [--seconds N] [--patience SECONDS] [--seed S]\n");
      std::exit(2);
    }
  }
  return options;
}

/// Own draws: those of the standard library differ between platforms.
class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}
  int below(int n) {
    return static_cast<int>((engine_() >> 32) * static_cast<std::uint64_t>(n) >> 32);
  }
  bool chance(int percent) { return below(100) < percent; }

 private:
  std::mt19937_64 engine_;
};

/// One system from start to shutdown, and the threads that disturb it.
class Session {
 public:
  Session(ImageRing& images, Counts& counts, Watchdog& watchdog, std::uint64_t seed)
      : counts_(counts), system_(images, counts, watchdog, seed), seed_(seed) {}

  /// Ends after `n_frames`, or when it is enough.
  void run(int n_frames, const std::function<bool()>& enough, bool drain) {
    std::thread threads[] = {
        std::thread([this] {
          while (!done_) system_.track_next();
        }),
        std::thread([this] { control(); }),
        std::thread([this] { refine(); }),
        std::thread([this] { look(); }),
    };
    const int until = counts_.frames + n_frames;
    while (counts_.frames < until && !enough()) {
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    system_.shutdown(drain);  // while the others go on
    done_ = true;
    for (std::thread& thread : threads) thread.join();
  }

 private:
  /// Sleeps until some more frames have been tracked; false at the end.
  bool wait_for_frames(int n) {
    const int until = counts_.frames + n;
    while (counts_.frames < until && !done_) {
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return !done_;
  }

  void control() {
    Random random(seed_);
    int loops = counts_.loops_closed, frames_at_reset = counts_.frames;
    const auto reset = [&] {
      loops = counts_.loops_closed;
      frames_at_reset = counts_.frames;
      system_.request_reset();
    };
    while (wait_for_frames(1 + random.below(kFramesPerLap / 3))) {
      if (system_.localization_wanted()) {
        // The mode ends soon; now and then a reset comes first.
        if (random.chance(10)) reset();
        system_.request_localization(false);
        continue;
      }
      const int action = random.below(100);
      // The same map sees no second loop at this place, and a map that has been tracked badly sees
      // none at all.
      const bool stale = counts_.frames > frames_at_reset + 4 * kFramesPerLap;
      if (action < 2 || (action < 60 && (stale || counts_.loops_closed != loops))) {
        reset();
      } else if (action < 4) {
        system_.request_jump();
      } else if (action < 12) {
        system_.request_map();
      } else if (action < 20) {
        system_.request_localization(true);
      } else if (action < 60) {
        const std::chrono::milliseconds duration(random.below(20));
        system_.pause(random.below(3), random.chance(50), duration);
      }
    }
  }

  void refine() {
    Random random(seed_ + 1);
    while (wait_for_frames(random.below(2 * kFramesPerLap))) system_.optimize();
  }

  void look() {
    Random random(seed_ + 2);
    while (!done_) {
      system_.look();
      std::this_thread::sleep_for(std::chrono::milliseconds(200 + random.below(400)));
    }
  }

  Counts& counts_;
  System system_;
  const std::uint64_t seed_;
  std::atomic<bool> done_{false};
};

void print(const Counts& c, const Watchdog& watchdog, double minutes) {
  std::printf("%d frames (%.0f a minute), %d keyframes, %d lost, %d relocalized, %d localized\n",
              c.frames.load(), c.frames / minutes, c.keyframes.load(), c.lost.load(),
              c.relocalized.load(), c.localized.load());
  std::printf("%d loops closed (%.1f a minute), %d corrections dropped, %d candidates verified\n",
              c.loops_closed.load(), c.loops_closed / minutes, c.corrections_dropped.load(),
              c.verified.load());
  std::printf("full adjustments: %d begun, %d committed, %d given up\n", c.adjustments_begun.load(),
              c.adjustments_committed.load(), c.adjustments_dropped.load());
  std::printf("%d resets, %d mode switches, %d pauses, %d looks, %d shutdowns\n", c.resets.load(),
              c.mode_switches.load(), c.pauses.load(), c.snapshots.load(), c.shutdowns.load());
  std::printf("maps: %d begun beside others, %d merged, %d found again, %d dropped\n",
              c.maps_begun.load(), c.maps_merged.load(), c.maps_switched.load(),
              c.maps_dropped.load());
  std::printf("slowest:");
  for (const auto& [name, ms] : watchdog.slowest()) std::printf(" %s %.0f ms;", name.c_str(), ms);
  std::printf("\n");
}

/// What must happen for the run to mean anything, and has not.
std::vector<std::string> missing(const Counts& c) {
  const std::pair<const char*, int> needed[] = {
      {"loop closed", c.loops_closed},
      {"full adjustment committed", c.adjustments_committed},
      {"full adjustment given up", c.adjustments_dropped},
      {"reset", c.resets},
      {"mode switch", c.mode_switches},
      {"frame in localization mode", c.localized},
      {"pause", c.pauses},
      {"look at the map", c.snapshots},
      {"map begun beside another", c.maps_begun},
      {"merge", c.maps_merged}};
  std::vector<std::string> result;
  for (const auto& [what, count] : needed) {
    if (count == 0) result.emplace_back(what);
  }
  return result;
}

}  // namespace

/// CHOLMOD works with OpenMP, whose runtime is not built for the sanitizer: it does not see that
/// these threads wait for each other.
extern "C" const char* __tsan_default_suppressions();
extern "C" const char* __tsan_default_suppressions() {
  return "called_from_lib:libcholmod.so\nrace:libgomp.so\n";
}

int main(int argc, char** argv) {
  const Options options = parse(argc, argv);
  ImageRing images(kFramesPerLap, options.seed);
  Counts counts;
  Watchdog watchdog(options.patience);
  Random random(options.seed);
  const auto begin = Clock::now();
  const auto seconds = [begin] {
    return std::chrono::duration<double>(Clock::now() - begin).count();
  };
  // On a slow machine it takes longer until everything has happened.
  const auto enough = [&] {
    return seconds() > (missing(counts).empty() ? 1 : 6) * options.seconds;
  };
  for (std::uint64_t n = 0; !enough(); ++n) {
    Session session(images, counts, watchdog, options.seed * 1000 + n);
    session.run(kFramesPerLap * (1 + random.below(8)), enough, random.chance(50));
  }
  print(counts, watchdog, seconds() / 60);
  const std::vector<std::string> lacking = missing(counts);
  for (const std::string& what : lacking) std::printf("no %s\n", what.c_str());
  return lacking.empty() ? EXIT_SUCCESS : EXIT_FAILURE;
}
