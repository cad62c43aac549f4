// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <benchmark/benchmark.h>
#include <time.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

/// Keyframes of the made-up maps in which what a loop costs is measured.
inline const std::vector<std::int64_t> kMapSizes{250, 500, 1000, 2000, 4000, 10000};

/// Wall-clock time since it was made.
class Stopwatch {
 public:
  double milliseconds() const {
    const std::chrono::duration<double, std::milli> taken = Clock::now() - began_;
    return taken.count();
  }

 private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point began_ = Clock::now();
};

/// A clock of the C library [ms]. Processor time is the better measure while other programs run.
inline double milliseconds_of(clockid_t clock) {
  timespec now{};
  clock_gettime(clock, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

/// Reports least, median and 99th percentile of times in milliseconds: `min_ms`, `median_ms` and
/// `p99_ms` after the prefix.
inline void report_times(benchmark::State& state, std::vector<double> milliseconds,
                         const std::string& prefix = "") {
  std::sort(milliseconds.begin(), milliseconds.end());
  state.counters[prefix + "min_ms"] = milliseconds.front();
  state.counters[prefix + "median_ms"] = milliseconds[milliseconds.size() / 2];
  state.counters[prefix + "p99_ms"] = milliseconds[milliseconds.size() * 99 / 100];
}

/// Runs `work` on what `prepare` returns, which is not timed (UseManualTime), and reports.
template <class Prepare, class Work>
void measure_prepared(benchmark::State& state, Prepare prepare, Work work) {
  std::vector<double> milliseconds, processor;
  for (auto _ : state) {
    auto input = prepare();
    const double processor_began = milliseconds_of(CLOCK_THREAD_CPUTIME_ID);
    const Stopwatch watch;
    work(input);
    milliseconds.push_back(watch.milliseconds());
    processor.push_back(milliseconds_of(CLOCK_THREAD_CPUTIME_ID) - processor_began);
    state.SetIterationTime(1e-3 * milliseconds.back());
  }
  report_times(state, milliseconds);
  report_times(state, processor, "cpu_");
}

/// Runs `work` and reports.
template <class Work>
void measure(benchmark::State& state, Work work) {
  std::vector<double> milliseconds;
  for (auto _ : state) {
    const Stopwatch watch;
    work();
    milliseconds.push_back(watch.milliseconds());
  }
  report_times(state, milliseconds);
}
