// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#ifdef ORBSLAM2PY_OPENMP
#include <omp.h>
#endif

namespace orbslam {

/// While it lives, parallel OpenMP regions that this thread enters have no other threads. CHOLMOD
/// always asks for four threads of its own. They would take processor time from tracking and, on
/// two processors, would not be faster. See docs/decisions.md, number 30.
class SingleOpenMpThread {
 public:
#ifdef ORBSLAM2PY_OPENMP
  SingleOpenMpThread() : levels_(omp_get_max_active_levels()) { omp_set_max_active_levels(0); }
  ~SingleOpenMpThread() {
    // Old run-time libraries have one setting for all threads; then another thread restores it.
    if (levels_ > 0) omp_set_max_active_levels(levels_);
  }
#else
  SingleOpenMpThread() {}
#endif
  SingleOpenMpThread(const SingleOpenMpThread&) = delete;
  SingleOpenMpThread& operator=(const SingleOpenMpThread&) = delete;

#ifdef ORBSLAM2PY_OPENMP
 private:
  int levels_;
#endif
};

}  // namespace orbslam
