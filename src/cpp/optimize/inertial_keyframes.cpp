// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/inertial_keyframes.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <utility>

#include "inertial/inertial_filter.hpp"
#include "optimize/bundle_gather.hpp"

namespace orbslam {
namespace {

// Longest time between two keyframes that samples join [s].
constexpr double kLongest = 5.0;
// Longest time between neighbours [s] that culling may leave, near the newest keyframe and before.
constexpr double kGap = 0.5, kGapBefore = 3.0;
// Age [s] up to which the short limit holds: in this time the scale of a single camera becomes
// known.
constexpr double kRecent = 15.0;
// Times closer than this are the same [s]; seconds since 1970 are exact to 2e-7.
constexpr double kSame = 1e-6;
// Longest time [s] from an end of an interval to its nearest sample.
constexpr double kMissing = 1e-3;
// Standard deviations [rad/s, m/s^2] of the prior on the bias of the first motion in a chain, which
// nothing else determines.
constexpr double kGyroDeviation = 5e-3, kAccelDeviation = 0.1;

using Samples = std::vector<ImuSample>;

void append(Samples::const_iterator first, Samples::const_iterator last, Samples& samples) {
  for (; first != last; ++first) {
    if (samples.empty() || first->t > samples.back().t + kSame) samples.push_back(*first);
  }
}

Samples::const_iterator at_time(const Samples& samples, double t) {
  return std::lower_bound(samples.begin(), samples.end(), t,
                          [](const ImuSample& s, double time) { return s.t < time; });
}

/// Whether an IMU may join two moments, as far as is known without looking at all samples.
bool covers(const Samples& samples, double begin, double end) {
  return end > begin && end - begin <= kLongest && !samples.empty() &&
         samples.front().t <= begin + kMissing && samples.back().t >= end - kMissing;
}

/// The samples in an interval, with one at or before its begin and one at or after its end.
std::pair<Samples::const_iterator, Samples::const_iterator> around(const Samples& samples,
                                                                   double begin, double end) {
  auto first = at_time(samples, std::nextafter(begin + kSame, end));
  if (first != samples.begin()) --first;
  auto last = at_time(samples, end - kSame);
  if (last != samples.end()) ++last;
  return {first, last};
}

}  // namespace

void InertialKeyframes::add_samples(const std::vector<ImuSample>& samples) {
  const std::lock_guard lock(mutex_);
  append(samples.begin(), samples.end(), samples_.back());
}

void InertialKeyframes::set(KeyFrameId keyframe, const Eigen::Vector3d& velocity,
                            const ImuBias& bias, double scale) {
  const std::lock_guard lock(mutex_);
  set_state(keyframe, velocity, bias, scale);
}

void InertialKeyframes::set_state(KeyFrameId keyframe, const Eigen::Vector3d& velocity,
                                  const ImuBias& bias, double scale) {
  const auto [state, is_new] = states_.try_emplace(keyframe);
  const std::size_t stretch = is_new ? samples_.size() - 1 : state->second.stretch;
  state->second = {velocity, bias, scale, stretch, ++n_changes_};
}

void InertialKeyframes::clear() {
  const std::lock_guard lock(mutex_);
  states_.clear();
  samples_.assign(1, {});
}

std::size_t InertialKeyframes::size() const {
  const std::lock_guard lock(mutex_);
  return states_.size();
}

const InertialKeyframes::State* InertialKeyframes::state_of(KeyFrameId keyframe) const {
  const auto found = states_.find(keyframe);
  return found == states_.end() ? nullptr : &found->second;
}

bool InertialKeyframes::find(KeyFrameId keyframe, Eigen::Vector3d& velocity, ImuBias& bias) const {
  const std::lock_guard lock(mutex_);
  const State* state = state_of(keyframe);
  if (state == nullptr) return false;
  velocity = state->velocity;
  bias = state->bias;
  return true;
}

bool InertialKeyframes::newest_bias(ImuBias& bias) const {
  const std::lock_guard lock(mutex_);
  if (states_.empty()) return false;
  bias = states_.rbegin()->second.bias;
  return true;
}

InertialRows InertialKeyframes::take(const std::vector<KeyFrameId>& keyframes,
                                     const std::vector<double>& times,
                                     const std::vector<std::array<std::int64_t, 3>>& known) const {
  const std::lock_guard lock(mutex_);
  InertialRows rows;
  const State* before = nullptr;
  double time_before = 0;
  for (std::size_t i = 0; i < keyframes.size(); ++i) {
    const State* state = state_of(keyframes[i]);
    if (state == nullptr) continue;
    rows.versions.push_back(
        {keyframes[i].value, before ? rows.ids.back().value : -1, state->last_change});
    const bool is_known = std::binary_search(known.begin(), known.end(), rows.versions.back());
    rows.changed.push_back(is_known ? 0 : 1);
    rows.ids.push_back(keyframes[i]);
    rows.velocity.push_back(state->velocity);
    rows.scale.push_back(state->scale);
    rows.bias.push_back(state->bias);
    const Samples& samples = samples_[state->stretch];
    if (!is_known && before && before->stretch == state->stretch &&
        covers(samples, time_before, times[i])) {
      const auto [first, last] = around(samples, time_before, times[i]);
      rows.samples.insert(rows.samples.end(), first, last);
    }
    rows.offsets.push_back(rows.samples.size());
    before = state;
    time_before = times[i];
  }
  return rows;
}

void InertialKeyframes::put(const InertialRows& rows) {
  const std::lock_guard lock(mutex_);
  states_.clear();
  samples_.clear();
  for (std::size_t i = 0; i < rows.ids.size(); ++i) {
    // Without samples nothing joins it to the state before.
    if (i == 0 || rows.offsets[i] == rows.offsets[i + 1]) samples_.emplace_back();
    append(rows.samples.begin() + static_cast<std::ptrdiff_t>(rows.offsets[i]),
           rows.samples.begin() + static_cast<std::ptrdiff_t>(rows.offsets[i + 1]),
           samples_.back());
    set_state(rows.ids[i], rows.velocity[i], rows.bias[i], rows.scale[i]);
  }
  samples_.emplace_back();
}

std::vector<KeyFrameId> InertialKeyframes::newest(const Map& map, MapIndex which,
                                                  std::size_t n) const {
  const std::lock_guard lock(mutex_);
  std::vector<KeyFrameId> chain;
  // Ids grow with time.
  for (auto state = states_.rbegin(); state != states_.rend() && chain.size() < n; ++state) {
    if (is_of_earlier_run(state->second)) break;
    const KeyFrame* keyframe = map.find(state->first);
    if (keyframe != nullptr && keyframe->map == which) chain.push_back(state->first);
  }
  std::reverse(chain.begin(), chain.end());
  return chain;
}

bool InertialKeyframes::is_needed(const Map& map, KeyFrameId id) const {
  const std::lock_guard lock(mutex_);
  const auto at = states_.find(id);
  const KeyFrame* keyframe = map.find(id);
  if (at == states_.end() || keyframe == nullptr) return false;
  const auto time_of = [&](auto state, auto end) {
    for (; state != end; ++state) {
      const KeyFrame* other = map.find(state->first);
      const bool is_joined = state->second.stretch == at->second.stretch;
      if (is_joined && other != nullptr && other->map == keyframe->map) {
        return other->frame->timestamp;
      }
    }
    return std::numeric_limits<double>::quiet_NaN();
  };
  const double before = time_of(std::make_reverse_iterator(at), states_.rend());
  const double after = time_of(std::next(at), states_.end());
  const double newest = time_of(states_.rbegin(), states_.rend());
  if (is_of_earlier_run(at->second)) return after - before > kGapBefore;  // false at its ends
  if (std::isnan(after)) return true;                                     // the newest one
  if (std::isnan(before)) return false;                                   // the chain begins later
  return after - before > (newest - before < kRecent ? kGap : kGapBefore);
}

std::shared_ptr<const Preintegration> InertialKeyframes::between(std::size_t stretch, double begin,
                                                                 double end,
                                                                 const ImuBias& bias) const {
  const Samples& all = samples_[stretch];
  if (!covers(all, begin, end)) return nullptr;
  const Samples near(at_time(all, begin - 0.1), at_time(all, end + 0.1));
  if (near.size() < 2) return nullptr;
  std::vector<ImuSample> samples = samples_between(near, begin, end);
  // Of two readings at nearly the same time the one at the end of the interval stays.
  const auto same = [](const ImuSample& a, const ImuSample& b) { return !(b.t > a.t + kSame); };
  samples.erase(samples.begin() + 1,
                std::find_if(samples.begin() + 1, samples.end() - 1,
                             [&](const ImuSample& s) { return !same(samples.front(), s); }));
  while (samples.size() > 2 && same(samples[samples.size() - 2], samples.back())) {
    samples.erase(samples.end() - 2);
  }
  auto motion = std::make_shared<Preintegration>(std::move(samples), noise_, bias);
  return motion->flags().n_gaps > 0 ? nullptr : motion;
}

void InertialKeyframes::add_to(GatheredBundle& bundle, const std::vector<KeyFrameId>& chain,
                               const Map& map) const {
  const std::lock_guard lock(mutex_);
  auto& inertial = bundle.problem.inertial;
  inertial.T_cb = T_cb_;
  inertial.gravity = {0, 0, -kGravity};
  for (std::size_t i = 0; i < chain.size(); ++i) {
    const auto camera = bundle.camera_of.find(chain[i]);
    const State* state = state_of(chain[i]);
    if (camera == bundle.camera_of.end() || state == nullptr) continue;
    const KeyFrame& keyframe = *map.find(chain[i]);
    BundleProblem::Motion motion;
    motion.camera = camera->second;
    const double factor = keyframe.scale / state->scale;
    motion.velocity = keyframe.T_cw.rotation().conjugate() * (factor * state->velocity);
    motion.bias = state->bias;
    const bool is_first = inertial.motions.empty();
    // Also where its pose is fixed: a wrong bias must not stay because it was there before.
    if (is_first) {
      motion.bias_information << Eigen::Vector3d::Constant(1 / (kGyroDeviation * kGyroDeviation)),
          Eigen::Vector3d::Constant(1 / (kAccelDeviation * kAccelDeviation));
    }
    inertial.motions.push_back(motion);
    if (is_first) continue;
    const auto second = static_cast<std::uint32_t>(inertial.motions.size() - 1);
    const KeyFrame& before = *map.find(bundle.keyframes[inertial.motions[second - 1].camera]);
    // Of this run, as the whole chain.
    auto link = between(samples_.size() - 1, before.frame->timestamp, keyframe.frame->timestamp,
                        inertial.motions[second - 1].bias);
    if (link != nullptr) inertial.links.push_back({second - 1, second, std::move(link)});
  }
}

void InertialKeyframes::take_from(const GatheredBundle& bundle, const Map& map) {
  const std::lock_guard lock(mutex_);
  for (const BundleProblem::Motion& motion : bundle.problem.inertial.motions) {
    const KeyFrame* keyframe = map.find(bundle.keyframes[motion.camera]);
    if (motion.fixed || keyframe == nullptr) continue;
    const Eigen::Quaterniond& R_cw = bundle.problem.cameras[motion.camera].T_cw.rotation();
    set_state(keyframe->id, R_cw * motion.velocity, motion.bias, keyframe->scale);
  }
}

}  // namespace orbslam
