// SPDX-License-Identifier: BSD-3-Clause
// Full bundle adjustment after a loop, by number of keyframes (some 65 points each, 6 observations
// a point). One thread. Seconds are of processor time unless the name says wall, because other
// programs disturb; `write_ms` is how long the commit holds the map's write lock.
#include <benchmark/benchmark.h>
#include <dlfcn.h>
#include <malloc.h>
#include <pthread.h>

#include <chrono>
#include <fstream>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>

#include "measure.hpp"
#include "optimize/full_bundle_adjustment.hpp"
#include "support/loop_map.hpp"

namespace {

using namespace orbslam;
using testing::LoopMap;
using testing::LoopMapOptions;

double seconds_of(clockid_t clock) { return 1e-3 * milliseconds_of(clock); }

/// Write sections of this thread: the longest, in seconds of its processor time and of the wall.
struct WriteSections {
  double began = 0, wall_began = 0, longest = 0, wall_longest = 0;
  bool open = false;
};
thread_local WriteSections write_sections;

using LockFunction = int (*)(pthread_rwlock_t*);
LockFunction next(const char* name) {
  return reinterpret_cast<LockFunction>(dlsym(RTLD_NEXT, name));
}

/// Time of the process and of the wall.
class BothClocks {
 public:
  double seconds() const { return seconds_of(CLOCK_PROCESS_CPUTIME_ID) - began_; }
  double wall_seconds() const { return seconds_of(CLOCK_MONOTONIC) - wall_began_; }

 private:
  double began_ = seconds_of(CLOCK_PROCESS_CPUTIME_ID);
  double wall_began_ = seconds_of(CLOCK_MONOTONIC);
};

/// What the process holds at most since this was made, beyond what it held then.
class PeakMemory {
 public:
  PeakMemory() {
    // Sets the mark of the most that was held to what is held now.
    std::ofstream("/proc/self/clear_refs") << 5;
    before_kb_ = held_kb("VmRSS:");
  }
  double kilobytes() const { return held_kb("VmHWM:") - before_kb_; }

 private:
  static double held_kb(const std::string& name) {
    std::ifstream status("/proc/self/status");
    for (std::string word; status >> word;) {
      if (word != name) continue;
      double kilobytes = 0;
      status >> kilobytes;
      return kilobytes;
    }
    throw std::runtime_error("/proc/self/status does not tell " + name);
  }

  double before_kb_ = 0;
};

LoopMapOptions loop_options(const benchmark::State& state, bool monocular) {
  LoopMapOptions options;
  options.n_keyframes = static_cast<int>(state.range(0));
  if (monocular) options.depth_limit = 0;
  options.outliers = 0.01;
  return options;
}

FullBundleOptions bundle_options(bool robust) {
  FullBundleOptions options;
  options.robust = robust;
  return options;
}

void BM_FullBundle(benchmark::State& state, bool monocular, bool robust) {
  for (auto _ : state) {
    LoopMap loop(loop_options(state, monocular));
    state.counters["error_before_m"] = loop.pose_error();
    // What building the map has freed would hide what the adjustment needs.
    malloc_trim(0);
    const PeakMemory memory;
    const BothClocks gathering;
    GatheredBundle bundle = gather_full_bundle(loop.map);
    state.counters["gather_ms"] = 1e3 * gathering.seconds();
    const BothClocks solving;
    const BundleSummary summary = solve_full_bundle(bundle, bundle_options(robust), nullptr, 1);
    state.counters["solve_s"] = solving.seconds();
    state.counters["solve_wall_s"] = solving.wall_seconds();
    state.counters["memory_kb"] = memory.kilobytes();
    write_sections = {};
    const BothClocks committing;
    if (!commit_full_bundle(loop.map, bundle).committed) state.SkipWithError("not committed");
    state.counters["commit_ms"] = 1e3 * committing.seconds();
    state.counters["write_ms"] = 1e3 * write_sections.longest;
    state.counters["write_wall_ms"] = 1e3 * write_sections.wall_longest;
    state.SetIterationTime(gathering.wall_seconds());
    state.counters["points"] = static_cast<double>(bundle.points.size());
    state.counters["observations"] = static_cast<double>(bundle.problem.observations.size());
    state.counters["steps"] = summary.iterations;
    state.counters["cost_ratio"] = summary.final_cost / summary.initial_cost;
    state.counters["error_m"] = loop.pose_error();
  }
}

#define ONCE UseManualTime()->Iterations(1)->Unit(benchmark::kMillisecond)
BENCHMARK_CAPTURE(BM_FullBundle, stereo, false, true)->ArgsProduct({kMapSizes})->ONCE;
BENCHMARK_CAPTURE(BM_FullBundle, mono, true, true)->ArgsProduct({kMapSizes})->ONCE;
BENCHMARK_CAPTURE(BM_FullBundle, stereo_without_kernel, false, false)->Arg(1000)->ONCE;

/// From raising the flag until the solver returns, raised at moments spread over a run.
void BM_AbortLatency(benchmark::State& state) {
  const LoopMap loop(loop_options(state, false));
  const GatheredBundle gathered = gather_full_bundle(loop.map);
  double longest = 0, longest_wall = 0, sum = 0;
  int n = 0;
  for (auto _ : state) {
    for (double part = 0.05; part < 4; part += 0.25) {
      GatheredBundle bundle = gathered;
      std::atomic<bool> abort{false}, done{false};
      const BothClocks run;
      double raised = 0, wall_raised = 0;
      std::thread other([&] {
        while (!done && run.seconds() < part) {
          std::this_thread::sleep_for(std::chrono::milliseconds(2));
        }
        raised = run.seconds();
        wall_raised = run.wall_seconds();
        abort = true;
      });
      const bool aborted = solve_full_bundle(bundle, bundle_options(true), &abort, 1).aborted;
      const double returned = run.seconds(), wall_returned = run.wall_seconds();
      done = true;
      other.join();
      if (!aborted) continue;
      longest = std::max(longest, returned - raised);
      longest_wall = std::max(longest_wall, wall_returned - wall_raised);
      sum += returned - raised;
      ++n;
    }
    state.SetIterationTime(longest_wall);
  }
  state.counters["longest_s"] = longest;
  state.counters["longest_wall_s"] = longest_wall;
  state.counters["mean_s"] = sum / n;
  state.counters["aborted"] = n;
}
BENCHMARK(BM_AbortLatency)->Arg(1000)->ONCE;

}  // namespace

// In front of the functions under std::shared_mutex.
extern "C" {

int pthread_rwlock_wrlock(pthread_rwlock_t* lock) noexcept {
  static const LockFunction function = next("pthread_rwlock_wrlock");
  const int result = function(lock);
  write_sections.open = true;
  write_sections.began = seconds_of(CLOCK_THREAD_CPUTIME_ID);
  write_sections.wall_began = seconds_of(CLOCK_MONOTONIC);
  return result;
}

int pthread_rwlock_unlock(pthread_rwlock_t* lock) noexcept {
  static const LockFunction function = next("pthread_rwlock_unlock");
  WriteSections& s = write_sections;
  if (s.open) {
    s.open = false;
    s.longest = std::max(s.longest, seconds_of(CLOCK_THREAD_CPUTIME_ID) - s.began);
    s.wall_longest = std::max(s.wall_longest, seconds_of(CLOCK_MONOTONIC) - s.wall_began);
  }
  return function(lock);
}
}
