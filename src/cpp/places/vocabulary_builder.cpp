// SPDX-License-Identifier: BSD-3-Clause
#include "places/vocabulary_builder.hpp"

#include <cmath>
#include <cstring>

#include "base/errors.hpp"

namespace orbslam {
namespace {

void check_parameters(const TreeParameters& parameters) {
  const auto check = [](const char* name, int value, int low, int high) {
    if (value < low || value > high) {
      throw VocabularyError("not a vocabulary: " + std::string(name) + " is " +
                            std::to_string(value) + ", must be " + std::to_string(low) + " to " +
                            std::to_string(high));
    }
  };
  check("branching", parameters.branching, 2, 20);
  check("depth", parameters.depth, 1, 10);
  check("scoring", static_cast<int>(parameters.scoring), 0, 5);
  check("weighting", static_cast<int>(parameters.weighting), 0, 3);
}

/// Children of every node in ascending order: those of node i are
/// children[offsets[i]] .. children[offsets[i + 1] - 1].
struct Children {
  std::vector<std::uint32_t> offsets;
  std::vector<std::uint32_t> children;
};

Children list_children(const NodeRows& rows) {
  Children lists;
  lists.offsets.assign(rows.count + 2, 0);
  lists.children.resize(rows.count);
  // Counts are stored one place further up, so that the filling loop turns each end into a begin.
  for (std::size_t i = 0; i < rows.count; ++i) ++lists.offsets[rows.parents[i] + 2];
  for (std::size_t i = 2; i < lists.offsets.size(); ++i) lists.offsets[i] += lists.offsets[i - 1];
  for (std::size_t i = 0; i < rows.count; ++i) {
    lists.children[lists.offsets[rows.parents[i] + 1]++] = static_cast<std::uint32_t>(i + 1);
  }
  return lists;
}

}  // namespace

std::optional<NodeProblem> find_problem(int branching, int depth, const NodeRows& rows) {
  std::vector<std::uint8_t> level(rows.count + 1, 0), n_children(rows.count + 1, 0);
  for (std::size_t node = 1; node <= rows.count; ++node) {
    const std::size_t row = node - 1, parent = rows.parents[row];
    const double weight = rows.weights[row];
    const auto problem = [node](const std::string& what) { return NodeProblem{node, what}; };
    if (parent >= node) {
      return problem("its parent " + std::to_string(parent) + " is not listed before it");
    }
    if (parent > 0 && rows.is_word[parent - 1] != 0) {
      return problem("its parent " + std::to_string(parent) + " is marked as a word");
    }
    level[node] = static_cast<std::uint8_t>(level[parent] + 1);
    if (level[node] > depth) {
      return problem("it lies deeper than " + std::to_string(depth) + " levels");
    }
    if (++n_children[parent] > branching) {
      return problem("its parent " + std::to_string(parent) + " has more than " +
                     std::to_string(branching) + " children");
    }
    if (!std::isfinite(weight) || weight < 0) {
      return problem("its weight is negative or not finite");
    }
  }
  for (std::size_t node = 1; node <= rows.count; ++node) {
    if (rows.is_word[node - 1] == 0 && n_children[node] == 0) {
      return NodeProblem{node, "it has no children but is not marked as a word"};
    }
  }
  return std::nullopt;
}

NodeRows rows_of(const NodeTable& table) {
  return {table.parents.size(), table.parents.data(), table.is_word.data(),
          reinterpret_cast<const std::uint8_t*>(table.centres.data()), table.weights.data()};
}

VocabularyImage build_image(const TreeParameters& parameters, const NodeRows& rows) {
  check_parameters(parameters);
  if (rows.count == 0) throw VocabularyError("not a vocabulary: it has no words");
  if (const auto problem = find_problem(parameters.branching, parameters.depth, rows)) {
    throw VocabularyError("node " + std::to_string(problem->node) + ": " + problem->what);
  }
  std::uint32_t n_words = 0;
  std::vector<std::uint32_t> word_of(rows.count);
  for (std::size_t i = 0; i < rows.count; ++i) {
    if (rows.is_word[i] != 0) word_of[i] = n_words++;
  }

  VocabularyImage image = VocabularyImage::allocate(rows.count + 1, n_words);
  VocabularyHeader& header = image.edit_header();
  header.branching = static_cast<std::uint32_t>(parameters.branching);
  header.depth = static_cast<std::uint32_t>(parameters.depth);
  header.scoring = static_cast<std::uint32_t>(parameters.scoring);
  header.weighting = static_cast<std::uint32_t>(parameters.weighting);
  Descriptor* centres = image.edit(image.centres());
  std::uint8_t* child_count = image.edit(image.child_count());
  std::uint32_t* link = image.edit(image.link());
  std::uint32_t* original_id = image.edit(image.original_id());
  double* weight = image.edit(image.weight());

  // original_id doubles as the queue of the breadth-first walk.
  const Children lists = list_children(rows);
  std::uint32_t queue_end = 1;
  for (std::uint32_t node = 0; node < queue_end; ++node) {
    const std::uint32_t id = original_id[node];
    if (id > 0)
      std::memcpy(&centres[node], rows.centres + (id - 1) * sizeof(Descriptor), sizeof(Descriptor));
    if (id > 0 && rows.is_word[id - 1] != 0) {
      link[node] = word_of[id - 1];
      weight[link[node]] = rows.weights[id - 1];
      continue;
    }
    link[node] = queue_end;
    for (std::uint32_t i = lists.offsets[id]; i < lists.offsets[id + 1]; ++i) {
      original_id[queue_end++] = lists.children[i];
    }
    child_count[node] = static_cast<std::uint8_t>(queue_end - link[node]);
  }
  image.seal();
  return image;
}

NodeTable unpack_image(const VocabularyImage& image, const std::string& name) {
  const std::size_t n_nodes = image.header().n_nodes;
  const std::uint32_t* ids = image.original_id();
  std::vector<bool> seen(n_nodes, false);
  for (std::size_t node = 0; node < n_nodes; ++node) {
    if (ids[node] >= n_nodes || seen[ids[node]] || (ids[node] == 0) != (node == 0)) {
      throw VocabularyError(name + ": the numbers of its nodes are damaged; convert it again");
    }
    seen[ids[node]] = true;
  }
  NodeTable table;
  table.parents.resize(n_nodes - 1);
  table.is_word.resize(n_nodes - 1);
  table.centres.resize(n_nodes - 1);
  table.weights.assign(n_nodes - 1, 0.0);
  for (std::size_t node = 0; node < n_nodes; ++node) {
    const std::uint32_t first = image.link()[node], count = image.child_count()[node];
    for (std::uint32_t child = first; child < first + count; ++child) {
      table.parents[ids[child] - 1] = ids[node];
    }
    if (node == 0) continue;
    const std::size_t row = ids[node] - 1;
    table.centres[row] = image.centres()[node];
    table.is_word[row] = count == 0 ? 1 : 0;
    if (count == 0) table.weights[row] = image.weight()[first];
  }
  return table;
}

}  // namespace orbslam
