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
// Standard deviations [rad/s, m/s^2] of the prior on the bias of the first motion in a chain, which
// nothing else determines.
constexpr double kGyroDeviation = 5e-3, kAccelDeviation = 0.1;

}  // namespace

void InertialKeyframes::add_samples(const std::vector<ImuSample>& samples) {
  const std::lock_guard lock(mutex_);
  for (const ImuSample& sample : samples) {
    if (samples_.empty() || sample.t > samples_.back().t + kSame) samples_.push_back(sample);
  }
}

void InertialKeyframes::set(KeyFrameId keyframe, const Eigen::Vector3d& velocity,
                            const ImuBias& bias, double scale) {
  const std::lock_guard lock(mutex_);
  states_[keyframe] = {velocity, bias, scale};
}

void InertialKeyframes::clear() {
  const std::lock_guard lock(mutex_);
  states_.clear();
  samples_.clear();
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

std::vector<KeyFrameId> InertialKeyframes::newest(const Map& map, MapIndex which,
                                                  std::size_t n) const {
  const std::lock_guard lock(mutex_);
  std::vector<KeyFrameId> chain;
  // Ids grow with time.
  for (auto state = states_.rbegin(); state != states_.rend() && chain.size() < n; ++state) {
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
      if (other != nullptr && other->map == keyframe->map) return other->frame->timestamp;
    }
    return std::numeric_limits<double>::quiet_NaN();
  };
  const double before = time_of(std::make_reverse_iterator(at), states_.rend());
  const double after = time_of(std::next(at), states_.end());
  const double newest = time_of(states_.rbegin(), states_.rend());
  if (std::isnan(after)) return true;    // the newest one
  if (std::isnan(before)) return false;  // the chain begins later
  return after - before > (newest - before < kRecent ? kGap : kGapBefore);
}

std::shared_ptr<const Preintegration> InertialKeyframes::between(double begin, double end,
                                                                 const ImuBias& bias) const {
  if (!(end > begin) || end - begin > kLongest || samples_.empty()) return nullptr;
  if (samples_.front().t > begin + 1e-3 || samples_.back().t < end - 1e-3) return nullptr;
  const auto first = std::lower_bound(samples_.begin(), samples_.end(), begin - 0.1,
                                      [](const ImuSample& s, double t) { return s.t < t; });
  const auto last = std::lower_bound(first, samples_.end(), end + 0.1,
                                     [](const ImuSample& s, double t) { return s.t < t; });
  const std::vector<ImuSample> around(first, last);
  if (around.size() < 2) return nullptr;
  std::vector<ImuSample> samples = samples_between(around, begin, end);
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
    auto link = between(before.frame->timestamp, keyframe.frame->timestamp,
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
    states_[keyframe->id] = {R_cw * motion.velocity, motion.bias, keyframe->scale};
  }
}

}  // namespace orbslam
