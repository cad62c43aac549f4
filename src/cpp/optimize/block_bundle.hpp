// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "optimize/bundle_adjustment.hpp"
#include "optimize/bundle_kernels.hpp"

namespace orbslam {

/// A bundle in the layout of the kernels: observations ordered by point, on the normalised image
/// plane. Those of free cameras (by camera) are separate from those of fixed ones. Memory is reused
/// for the next bundle.
class BlockBundle {
 public:
  /// Points are dealt to two tasks, whatever the number of threads: the sums of a task and their
  /// order do not depend on the thread.
  static constexpr std::size_t kTasks = 2;

  /// `usable`: per observation whether it has a weight at first.
  void build(const BundleProblem& problem, const std::vector<std::uint8_t>& usable);
  /// Gives every observation its weight or 0.
  void set_weights(const BundleProblem& problem, const std::vector<std::uint8_t>& off);

  std::size_t n_free() const { return free_cameras_.size(); }
  const std::vector<std::uint32_t>& free_cameras() const { return free_cameras_; }
  bool empty() const { return n_used_ == 0; }
  /// Camera of the problem by view: free ones, then the others.
  const std::vector<std::uint32_t>& cameras() const { return cameras_; }
  bool has_point(std::size_t point) const { return finite_point_[point] != 0; }
  /// Length of the arrays of a batch.
  std::size_t batch_size() const { return batch_size_; }
  /// Most observations of one point by free cameras.
  std::size_t longest() const { return longest_; }
  std::size_t n_slots() const { return free_.u.size(); }

  /// Fills in what is read: observations, ranges and points of a task.
  void describe(std::size_t task, bundle_kernels::Task& out) const;

 private:
  struct Slots {
    std::vector<double> u, v, right_u, base, weight_u, weight_v, weight_right;
    std::vector<std::uint32_t> view, point;
    /// By rows of three, then the last column; empty: all cameras are pinholes.
    std::array<std::vector<double>, 12> sight;
    void resize(std::size_t n, bool with_sights);
    bundle_kernels::Observations pointers() const;
  };
  void number_cameras(const BundleProblem& problem);
  void find_slots(const BundleProblem& problem);
  void order_by_camera(const BundleProblem& problem);
  void fill(const BundleProblem& problem);
  void fill_sights(const BundleProblem& problem);

  std::vector<std::uint32_t> free_cameras_, cameras_;
  std::vector<std::uint32_t> view_of_;      ///< per camera
  std::vector<std::uint8_t> finite_point_;  ///< per point
  std::vector<bundle_kernels::PointRange> ranges_;
  std::array<std::uint32_t, kTasks + 1> task_points_{};
  std::vector<std::uint32_t> slot_;         ///< per observation, in its list; kNone: takes no part
  std::vector<std::uint32_t> observation_;  ///< per slot of the free list
  bool sights_ = false;                     ///< a camera is no pinhole
  std::size_t n_used_ = 0, batch_size_ = 0, longest_ = 0;
  Slots free_, fixed_;
};

}  // namespace orbslam
