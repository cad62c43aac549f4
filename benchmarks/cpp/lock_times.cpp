// SPDX-License-Identifier: BSD-3-Clause
// How long the map's lock is held and waited for. Loaded in front of the C library (LD_PRELOAD), so
// that the extension is measured as it is shipped: it takes the place of the functions under
// std::shared_mutex, counts only calls from the extension, and writes what it saw at exit.
//
// ORBSLAM2PY_LOCK_TIMES names the output: one line per section, "w" or "r", microseconds waited,
// held, and of processor time used while it was held.
#include <dlfcn.h>
#include <link.h>
#include <pthread.h>
#include <time.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>

namespace {

using Clock = std::chrono::steady_clock;
using LockFunction = int (*)(pthread_rwlock_t*);

/// Processor time of this thread [us].
double thread_microseconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e6 * static_cast<double>(now.tv_sec) + 1e-3 * static_cast<double>(now.tv_nsec);
}

struct Section {
  float waited, held, used;  // microseconds
  char kind;
};

constexpr std::size_t kCapacity = std::size_t{1} << 21;

struct Log {
  std::unique_ptr<Section[]> sections{new Section[kCapacity]};
  std::atomic<std::size_t> size{0};

  void add(char kind, Clock::duration waited, Clock::duration held, double used) {
    const std::size_t i = size.fetch_add(1);
    if (i >= kCapacity) return;
    using Microseconds = std::chrono::duration<float, std::micro>;
    sections[i] = {Microseconds(waited).count(), Microseconds(held).count(),
                   static_cast<float>(used), kind};
  }

  ~Log() {
    const char* path = std::getenv("ORBSLAM2PY_LOCK_TIMES");
    std::FILE* file = path != nullptr ? std::fopen(path, "w") : nullptr;
    if (file == nullptr) return;
    for (std::size_t i = 0; i < std::min(size.load(), kCapacity); ++i) {
      const Section& s = sections[i];
      std::fprintf(file, "%c %.1f %.1f %.1f\n", s.kind, static_cast<double>(s.waited),
                   static_cast<double>(s.held), static_cast<double>(s.used));
    }
    std::fclose(file);
  }
};

Log& log() {
  static Log instance;
  return instance;
}

LockFunction next(const char* name) {
  return reinterpret_cast<LockFunction>(dlsym(RTLD_NEXT, name));
}

/// Addresses of the extension's code; both 0 until it is loaded.
std::atomic<std::uintptr_t> extension_begin{0}, extension_end{0};

int find_extension(dl_phdr_info* info, std::size_t, void*) {
  if (std::strstr(info->dlpi_name, "orbslam2py/_core.") == nullptr) return 0;
  std::uintptr_t end = 0;
  for (int i = 0; i < info->dlpi_phnum; ++i) {
    const auto& part = info->dlpi_phdr[i];
    if (part.p_type == PT_LOAD) end = std::max(end, info->dlpi_addr + part.p_vaddr + part.p_memsz);
  }
  extension_end = end;
  extension_begin = info->dlpi_addr;
  return 1;
}

bool is_from_extension(const void* caller) {
  if (extension_begin == 0) dl_iterate_phdr(find_extension, nullptr);
  const auto address = reinterpret_cast<std::uintptr_t>(caller);
  return extension_begin != 0 && address >= extension_begin && address < extension_end;
}

/// The section that this thread is in; the core never holds two locks.
struct Open {
  pthread_rwlock_t* lock = nullptr;
  char kind = 0;
  Clock::time_point asked, got;
  double used_before = 0;
};
thread_local Open open_section;

int enter(pthread_rwlock_t* lock, char kind, LockFunction function, const void* caller) {
  if (!is_from_extension(caller)) return function(lock);
  const auto asked = Clock::now();
  const int result = function(lock);
  const double used = thread_microseconds();
  open_section = {lock, kind, asked, Clock::now(), used};
  return result;
}

}  // namespace

extern "C" {

int pthread_rwlock_wrlock(pthread_rwlock_t* lock) noexcept {
  static const LockFunction function = next("pthread_rwlock_wrlock");
  return enter(lock, 'w', function, __builtin_return_address(0));
}

int pthread_rwlock_rdlock(pthread_rwlock_t* lock) noexcept {
  static const LockFunction function = next("pthread_rwlock_rdlock");
  return enter(lock, 'r', function, __builtin_return_address(0));
}

int pthread_rwlock_unlock(pthread_rwlock_t* lock) noexcept {
  static const LockFunction function = next("pthread_rwlock_unlock");
  const Open section = open_section;
  if (section.lock != lock) return function(lock);
  const auto now = Clock::now();
  const double used = thread_microseconds() - section.used_before;
  const int result = function(lock);
  open_section.lock = nullptr;
  log().add(section.kind, section.got - section.asked, now - section.got, used);
  return result;
}
}
