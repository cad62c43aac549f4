// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/block_bundle.hpp"

#include <algorithm>
#include <cmath>

namespace orbslam {
namespace {

using bundle_kernels::kLanes;
using bundle_kernels::PointRange;

constexpr std::uint32_t kNone = ~std::uint32_t{0};
/// Padding between the lists of two tasks, so that vectors of one list end before the next begins.
constexpr std::uint32_t kGap = 2 * kLanes;

bool is_finite(const BundleProblem::Observation& o) {
  return std::isfinite(o.u) && std::isfinite(o.v) && (!o.has_depth || std::isfinite(o.right_u)) &&
         std::isfinite(o.inverse_sigma2) && std::isfinite(o.right_factor);
}

bool is_finite(const BundleProblem::Camera& camera) {
  return camera.T_cw.rotation().coeffs().allFinite() && camera.T_cw.translation().allFinite();
}

}  // namespace

void BlockBundle::Slots::resize(std::size_t n, bool with_sights) {
  for (auto* values : {&u, &v, &right_u, &base, &weight_u, &weight_v, &weight_right}) {
    values->assign(n, 0.0);
  }
  for (auto& values : sight) values.assign(with_sights ? n : 0, 0.0);
  view.assign(n, 0);
  point.assign(n, 0);
}

bundle_kernels::Observations BlockBundle::Slots::pointers() const {
  bundle_kernels::Observations all{u.data(),
                                   v.data(),
                                   right_u.data(),
                                   base.data(),
                                   weight_u.data(),
                                   weight_v.data(),
                                   weight_right.data(),
                                   view.data(),
                                   point.data(),
                                   {}};
  if (sight[0].empty()) return all;
  for (std::size_t k = 0; k < sight.size(); ++k) all.sight[k] = sight[k].data();
  return all;
}

void BlockBundle::build(const BundleProblem& problem, const std::vector<std::uint8_t>& usable) {
  number_cameras(problem);
  sights_ = std::any_of(problem.cameras.begin(), problem.cameras.end(),
                        [](const auto& camera) { return !camera.model->is_pinhole(); });
  find_slots(problem);
  order_by_camera(problem);
  sights_ ? fill_sights(problem) : fill(problem);
  std::vector<std::uint8_t> off(usable.size());
  for (std::size_t i = 0; i < off.size(); ++i) off[i] = usable[i] != 0 ? 0 : 1;
  set_weights(problem, off);
}

void BlockBundle::number_cameras(const BundleProblem& problem) {
  finite_point_.resize(problem.points.size());
  for (std::size_t i = 0; i < finite_point_.size(); ++i) {
    finite_point_[i] = problem.points[i].allFinite() ? 1 : 0;
  }
  std::vector<std::uint8_t> used(problem.cameras.size(), 0);
  n_used_ = 0;
  for (const auto& o : problem.observations) {
    used[o.camera] = 1;
    n_used_ += finite_point_[o.point];
  }
  free_cameras_.clear();
  cameras_.clear();
  view_of_.assign(problem.cameras.size(), kNone);
  for (const bool fixed : {false, true}) {
    for (std::uint32_t i = 0; i < used.size(); ++i) {
      const auto& camera = problem.cameras[i];
      if (used[i] == 0 || camera.fixed != fixed || !is_finite(camera)) continue;
      view_of_[i] = static_cast<std::uint32_t>(cameras_.size());
      cameras_.push_back(i);
      if (!fixed) free_cameras_.push_back(i);
    }
  }
}

/// Counts observations by point, deals points to tasks and gives every observation a slot.
void BlockBundle::find_slots(const BundleProblem& problem) {
  const std::size_t n_points = problem.points.size();
  ranges_.assign(n_points, PointRange{});
  slot_.assign(problem.observations.size(), kNone);
  for (std::size_t i = 0; i < slot_.size(); ++i) {
    const auto& o = problem.observations[i];
    if (view_of_[o.camera] == kNone || finite_point_[o.point] == 0 || !is_finite(o)) continue;
    PointRange& range = ranges_[o.point];
    slot_[i] = view_of_[o.camera] < n_free() ? range.free_end++ : range.fixed_end++;
  }
  double work = 0;
  const auto work_of = [](const PointRange& range) {
    const double n = range.free_end;
    return n * n + 8 * n + 4 * range.fixed_end + 4;
  };
  for (const PointRange& range : ranges_) work += work_of(range);
  std::uint32_t free = 0, fixed = 0;
  std::size_t task = 0;
  double done = 0;
  longest_ = 0;
  std::size_t longest_fixed = 0;
  task_points_.fill(static_cast<std::uint32_t>(n_points));
  task_points_[0] = 0;
  for (std::size_t i = 0; i < n_points; ++i) {
    PointRange& range = ranges_[i];
    if (task + 1 < kTasks && done * kTasks >= work * static_cast<double>(task + 1)) {
      task_points_[++task] = static_cast<std::uint32_t>(i);
      free += kGap;
      fixed += kGap;
    }
    done += work_of(range);
    longest_ = std::max<std::size_t>(longest_, range.free_end);
    longest_fixed = std::max<std::size_t>(longest_fixed, range.fixed_end);
    range = {free, free + range.free_end, fixed, fixed + range.fixed_end};
    free = range.free_end;
    fixed = range.fixed_end;
  }
  batch_size_ = std::max<std::size_t>({bundle_kernels::kBatch, longest_, longest_fixed}) + kGap;
  free_.resize(free + kGap, sights_);
  fixed_.resize(fixed + kGap, sights_);
}

/// Free cameras of every point ascending: blocks below the diagonal are enough then.
void BlockBundle::order_by_camera(const BundleProblem& problem) {
  observation_.assign(free_.u.size(), kNone);
  for (std::size_t i = 0; i < slot_.size(); ++i) {
    if (slot_[i] == kNone) continue;
    const auto& o = problem.observations[i];
    const PointRange& range = ranges_[o.point];
    const bool is_free = view_of_[o.camera] < n_free();
    slot_[i] += is_free ? range.free_begin : range.fixed_begin;
    if (is_free) observation_[slot_[i]] = static_cast<std::uint32_t>(i);
  }
  const auto before = [&](std::uint32_t a, std::uint32_t b) {
    const auto view_a = view_of_[problem.observations[a].camera];
    const auto view_b = view_of_[problem.observations[b].camera];
    return view_a != view_b ? view_a < view_b : a < b;
  };
  for (const PointRange& range : ranges_) {
    const auto begin = observation_.begin() + range.free_begin;
    const auto end = observation_.begin() + range.free_end;
    if (std::is_sorted(begin, end, before)) continue;
    std::sort(begin, end, before);
    for (std::uint32_t slot = range.free_begin; slot < range.free_end; ++slot) {
      slot_[observation_[slot]] = slot;
    }
  }
}

void BlockBundle::fill(const BundleProblem& problem) {
  for (std::size_t i = 0; i < slot_.size(); ++i) {
    if (slot_[i] == kNone) continue;
    const auto& o = problem.observations[i];
    const Camera& camera = *problem.cameras[o.camera].model;
    const Pinhole& k = camera.pinhole();
    const std::uint32_t view = view_of_[o.camera];
    Slots& slots = view < n_free() ? free_ : fixed_;
    const std::uint32_t slot = slot_[i];
    slots.view[slot] = view;
    slots.point[slot] = o.point;
    slots.u[slot] = (o.u - k.cx) / k.fx;
    slots.v[slot] = (o.v - k.cy) / k.fy;
    slots.right_u[slot] = o.has_depth ? (o.right_u - k.cx) / k.fx : 0.0;
    slots.base[slot] = o.has_depth ? camera.bf() / k.fx : 0.0;
  }
}

void BlockBundle::fill_sights(const BundleProblem& problem) {
  for (std::size_t i = 0; i < slot_.size(); ++i) {
    if (slot_[i] == kNone) continue;
    const auto& o = problem.observations[i];
    const Camera& camera = *problem.cameras[o.camera].model;
    const std::uint32_t view = view_of_[o.camera];
    Slots& slots = view < n_free() ? free_ : fixed_;
    const std::uint32_t slot = slot_[i];
    slots.view[slot] = view;
    slots.point[slot] = o.point;
    slots.right_u[slot] = o.has_depth ? o.u - o.right_u : 0.0;
    slots.base[slot] = o.has_depth ? camera.bf() : 0.0;
    // Where the lens shows nothing the observation is not usable, and 0 takes it out.
    const Sight B = camera.sight(o.u, o.v);
    for (std::size_t k = 0; k < slots.sight.size(); ++k) {
      const double entry = sight_entry(B, k);
      slots.sight[k][slot] = std::isfinite(entry) ? entry : 0.0;
    }
  }
}

void BlockBundle::set_weights(const BundleProblem& problem, const std::vector<std::uint8_t>& off) {
  for (std::size_t i = 0; i < slot_.size(); ++i) {
    if (slot_[i] == kNone) continue;
    const auto& o = problem.observations[i];
    const Pinhole& k = problem.cameras[o.camera].model->pinhole();
    Slots& slots = view_of_[o.camera] < n_free() ? free_ : fixed_;
    const double weight = off[i] != 0 ? 0.0 : static_cast<double>(o.inverse_sigma2);
    const std::uint32_t slot = slot_[i];
    slots.weight_u[slot] = sights_ ? weight : weight * (k.fx * k.fx);
    slots.weight_v[slot] = sights_ ? weight : weight * (k.fy * k.fy);
    const double right = static_cast<double>(o.right_factor);
    slots.weight_right[slot] = o.has_depth ? right * slots.weight_u[slot] : 0.0;
  }
}

void BlockBundle::describe(std::size_t task, bundle_kernels::Task& out) const {
  out.free = free_.pointers();
  out.fixed = fixed_.pointers();
  out.ranges = ranges_.data();
  out.point_begin = task_points_[task];
  out.point_end = task_points_[task + 1];
  out.n_free = static_cast<std::uint32_t>(n_free());
}

}  // namespace orbslam
