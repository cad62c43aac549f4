// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <pthread.h>

#include <cstddef>
#include <stdexcept>

namespace orbslam::testing {

/// While it lives, no thread can be started, as when the system has none left: none has room for
/// the stacks that are asked for.
class NoNewThreads {
 public:
  NoNewThreads() {
    pthread_attr_t attributes;
    if (pthread_getattr_default_np(&attributes) != 0) throw std::runtime_error("no attributes");
    pthread_attr_getstacksize(&attributes, &usual_);
    pthread_attr_destroy(&attributes);
    set(std::size_t{1} << 47);
  }
  ~NoNewThreads() { set(usual_); }
  NoNewThreads(const NoNewThreads&) = delete;
  NoNewThreads& operator=(const NoNewThreads&) = delete;

 private:
  static void set(std::size_t stack) {
    pthread_attr_t attributes;
    pthread_attr_init(&attributes);
    pthread_attr_setstacksize(&attributes, stack);
    pthread_setattr_default_np(&attributes);
    pthread_attr_destroy(&attributes);
  }

  std::size_t usual_ = 0;
};

}  // namespace orbslam::testing
