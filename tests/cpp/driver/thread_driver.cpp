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
      : counts_(counts),
        system_(images, counts, watchdog, seed),
        seed_(seed),
        at_reset_{counts.frames, counts.loops_closed, counts.maps_begun} {}

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

  enum class Action { none, reset, jump, begin_map, localize, pause };

  void control() {
    Random random(seed_);
    while (wait_for_frames(1 + random.below(kFramesPerLap / 3))) {
      if (system_.localization_wanted()) {
        // The mode ends soon; now and then a reset comes first.
        if (random.chance(10)) take(Action::reset, random);
        system_.request_localization(false);
        continue;
      }
      const Action drawn = draw(random);
      const Action due = due_now();
      take(due != Action::none && random.chance(70) ? due : drawn, random);
    }
  }

  Action draw(Random& random) const {
    const int number = random.below(100);
    if (number < 2) return Action::reset;
    if (number < 4) return Action::jump;
    if (number < 12) return Action::begin_map;
    if (number < 20) return Action::localize;
    return number < 60 ? Action::pause : Action::none;
  }

  /// What must happen and has not, which a slow machine cannot leave to chance; or a reset, when
  /// this map has shown what it can.
  Action due_now() const {
    const bool may_meet = counts_.maps_begun > at_reset_.maps_begun;
    const bool loop_closed = counts_.loops_closed > at_reset_.loops_closed;
    // A map that has been tracked badly sees no loop at all.
    const bool stale = counts_.frames > at_reset_.frames + 4 * kFramesPerLap;
    if (stale) return Action::reset;
    if (counts_.maps_merged == 0 && !may_meet) return Action::begin_map;
    if (counts_.localized == 0) return Action::localize;
    if (counts_.pauses == 0) return Action::pause;
    // The same map sees no second loop at this place.
    const bool waits_for_merge = counts_.maps_merged == 0;
    return loop_closed && !waits_for_merge ? Action::reset : Action::none;
  }

  void take(Action action, Random& random) {
    switch (action) {
      case Action::none:
        return;
      case Action::reset:
        at_reset_ = {counts_.frames, counts_.loops_closed, counts_.maps_begun};
        return system_.request_reset();
      case Action::jump:
        return system_.request_jump();
      case Action::begin_map:
        return system_.request_map();
      case Action::localize:
        return system_.request_localization(true);
      case Action::pause:
        const std::chrono::milliseconds duration(random.below(20));
        return system_.pause(random.below(3), random.chance(50), duration);
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
  /// What had happened when the map was last empty.
  struct {
    int frames, loops_closed, maps_begun;
  } at_reset_;
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
    return seconds() > (missing(counts).empty() ? 1 : 15) * options.seconds;
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
