// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <opencv2/core/mat.hpp>
#include <utility>

#include "base/worker_thread.hpp"
#include "features/orb_extractor.hpp"

namespace orbslam {

/// Features of both images of a pair (left, right), extracted at the same time: the right one in
/// the helper thread, the left one in the caller's. The result is that of one after the other.
///
/// The extractors must be two different ones (StateError). An exception of either side arrives
/// here after both have ended, the left one first. Images and masks as for
/// OrbExtractor::extract; both images must have the same size (ImageError). See
/// docs/method/frame.md#images.
std::pair<Extraction, Extraction> extract_pair(OrbExtractor& left_extractor,
                                               OrbExtractor& right_extractor, WorkerThread& helper,
                                               const cv::Mat& left, const cv::Mat& right,
                                               const cv::Mat& left_mask = {},
                                               const cv::Mat& right_mask = {});

/// Two extractors with the same options and their helper thread. One thread at a time: a second
/// caller gets a StateError before anything is touched.
class PairExtractor {
 public:
  explicit PairExtractor(const OrbOptions& options) : left_(options), right_(options) {}

  /// Extractions of (left, right); see extract_pair().
  std::pair<Extraction, Extraction> extract(const cv::Mat& left, const cv::Mat& right,
                                            const cv::Mat& left_mask = {},
                                            const cv::Mat& right_mask = {}) {
    return extract_pair(left_, right_, helper_, left, right, left_mask, right_mask);
  }

 private:
  OrbExtractor left_, right_;
  WorkerThread helper_;
};

}  // namespace orbslam
