// SPDX-License-Identifier: BSD-3-Clause
#include "frame/extract_pair.hpp"

#include <exception>
#include <string>

#include "base/errors.hpp"

namespace orbslam {

std::pair<Extraction, Extraction> extract_pair(OrbExtractor& left_extractor,
                                               OrbExtractor& right_extractor, WorkerThread& helper,
                                               const cv::Mat& left, const cv::Mat& right,
                                               const cv::Mat& left_mask,
                                               const cv::Mat& right_mask) {
  if (&left_extractor == &right_extractor) {
    throw StateError("left and right need an extractor each: an extractor serves one thread");
  }
  if (left.size() != right.size()) {
    throw ImageError("left image is " + std::to_string(left.cols) + "x" +
                     std::to_string(left.rows) + ", right image " + std::to_string(right.cols) +
                     "x" + std::to_string(right.rows) + "; a pair must have one size");
  }
  std::pair<Extraction, Extraction> pair;
  helper.start([&] { pair.second = right_extractor.extract(right, right_mask); });
  std::exception_ptr left_failure;
  try {
    pair.first = left_extractor.extract(left, left_mask);
  } catch (...) {
    // The job refers to this call's variables, so it must end before the exception leaves.
    left_failure = std::current_exception();
  }
  try {
    helper.finish();
  } catch (...) {
    if (!left_failure) throw;
  }
  if (left_failure) std::rethrow_exception(left_failure);
  return pair;
}

}  // namespace orbslam
