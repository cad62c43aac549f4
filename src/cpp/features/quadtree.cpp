// SPDX-License-Identifier: BSD-3-Clause
#include "features/quadtree.hpp"

#include <algorithm>
#include <cmath>

namespace orbslam {

const std::vector<Corner>& Quadtree::distribute(const std::vector<Corner>& corners, int width,
                                                int height, int quota) {
  kept_.clear();
  if (quota <= 0 || corners.empty()) return kept_;
  plant_roots(corners, width, height);
  const auto wanted = static_cast<std::size_t>(quota);
  for (;;) {
    const std::size_t before = leaf_count_;
    sweep();
    if (leaf_count_ >= wanted || leaf_count_ == before) break;
    if (leaf_count_ + 3 * open_.size() > wanted) {
      refine(wanted);
      break;
    }
  }
  for (std::size_t i = nodes_.size(); i-- > 0;) {
    const Node& node = nodes_[i];
    if (!node.is_leaf) continue;
    const Corner* begin = buffers_[node.side].data() + node.begin;
    const Corner* best = begin;
    for (const Corner* corner = begin + 1; corner < begin + node.count(); ++corner) {
      if (corner->response > best->response) best = corner;
    }
    kept_.push_back(*best);
  }
  return kept_;
}

void Quadtree::plant_roots(const std::vector<Corner>& corners, int width, int height) {
  nodes_.clear();
  open_.clear();
  for (auto& buffer : buffers_) buffer.resize(corners.size());

  const float aspect = static_cast<float>(width) / static_cast<float>(height);
  const int n_roots = std::max(1, static_cast<int>(std::round(aspect)));
  const float root_width = static_cast<float>(width) / static_cast<float>(n_roots);
  const auto root_of = [&](const Corner& corner) {
    return std::min(static_cast<int>(static_cast<float>(corner.x) / root_width), n_roots - 1);
  };
  std::vector<std::uint32_t>& place = todo_;  // where the next corner of each root goes
  place.assign(static_cast<std::size_t>(n_roots) + 1, 0);
  for (const Corner& corner : corners) ++place[static_cast<std::size_t>(root_of(corner)) + 1];
  for (std::size_t k = 1; k < place.size(); ++k) place[k] += place[k - 1];

  // Backwards, so that the first root is at the front of the list.
  for (int k = n_roots - 1; k >= 0; --k) {
    const auto root = static_cast<std::size_t>(k);
    const Node node{static_cast<int>(root_width * static_cast<float>(k)),
                    0,
                    static_cast<int>(root_width * static_cast<float>(k + 1)),
                    height,
                    place[root],
                    place[root + 1],
                    0,
                    true};
    if (node.count() == 0) continue;
    if (node.count() > 1) open_.push_back(static_cast<std::uint32_t>(nodes_.size()));
    nodes_.push_back(node);
  }
  leaf_count_ = nodes_.size();
  for (const Corner& corner : corners) {
    buffers_[0][place[static_cast<std::size_t>(root_of(corner))]++] = corner;
  }
}

void Quadtree::sweep() {
  todo_.swap(open_);
  open_.clear();
  for (std::size_t i = todo_.size(); i-- > 0;) divide(todo_[i]);
}

void Quadtree::refine(std::size_t quota) {
  for (;;) {
    const std::size_t before = leaf_count_;
    todo_.swap(open_);
    open_.clear();
    std::sort(todo_.begin(), todo_.end(), [this](std::uint32_t a, std::uint32_t b) {
      const std::uint32_t count_a = nodes_[a].count(), count_b = nodes_[b].count();
      return count_a != count_b ? count_a > count_b : a > b;
    });
    for (const std::uint32_t node : todo_) {
      divide(node);
      if (leaf_count_ >= quota) return;
    }
    if (leaf_count_ == before) return;
  }
}

void Quadtree::divide(std::uint32_t node_index) {
  nodes_[node_index].is_leaf = false;
  --leaf_count_;
  const Node node = nodes_[node_index];
  const int middle_x = node.left + (node.right - node.left + 1) / 2;
  const int middle_y = node.top + (node.bottom - node.top + 1) / 2;
  const auto quarter = [&](const Corner& corner) {
    return static_cast<unsigned>(corner.x >= middle_x) +
           2U * static_cast<unsigned>(corner.y >= middle_y);
  };
  const Corner* source = buffers_[node.side].data();
  Corner* target = buffers_[1 - node.side].data();
  std::uint32_t counts[4] = {0, 0, 0, 0};
  for (std::uint32_t i = node.begin; i < node.end; ++i) ++counts[quarter(source[i])];
  std::uint32_t place[4];
  std::uint32_t begin = node.begin;
  for (unsigned q = 0; q < 4; ++q) {
    place[q] = begin;
    begin += counts[q];
  }
  for (std::uint32_t i = node.begin; i < node.end; ++i) {
    target[place[quarter(source[i])]++] = source[i];
  }
  for (unsigned q = 0; q < 4; ++q) {
    if (counts[q] == 0) continue;
    if (counts[q] > 1) open_.push_back(static_cast<std::uint32_t>(nodes_.size()));
    nodes_.push_back({q % 2 == 0 ? node.left : middle_x, q < 2 ? node.top : middle_y,
                      q % 2 == 0 ? middle_x : node.right, q < 2 ? middle_y : node.bottom,
                      place[q] - counts[q], place[q], 1 - node.side, true});
    ++leaf_count_;
  }
}

}  // namespace orbslam
