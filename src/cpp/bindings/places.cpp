// SPDX-License-Identifier: BSD-3-Clause
#include <pybind11/functional.h>
#include <pybind11/stl.h>

#include <cstring>

#include "base/errors.hpp"
#include "bindings/arrays.hpp"
#include "bindings/bindings.hpp"
#include "places/place_recognition.hpp"
#include "places/vocabulary.hpp"
#include "places/vocabulary_training.hpp"

namespace orbslam::bindings {
namespace {

template <class Item>
using Column = py::array_t<Item, py::array::c_style>;

std::size_t check_descriptors(const Column<std::uint8_t>& rows) {
  if (rows.ndim() != 2 || rows.shape(1) != static_cast<py::ssize_t>(sizeof(Descriptor))) {
    throw VocabularyError("descriptors must be an array of shape (n, 32) and type uint8");
  }
  return static_cast<std::size_t>(rows.shape(0));
}

std::vector<Descriptor> to_descriptors(const Column<std::uint8_t>& rows) {
  std::vector<Descriptor> descriptors(check_descriptors(rows));
  if (!descriptors.empty()) {
    std::memcpy(static_cast<void*>(descriptors.data()), rows.data(), rows.nbytes());
  }
  return descriptors;
}

/// The columns as rows; they must outlive the result.
NodeRows to_rows(const Column<std::uint32_t>& parents, const Column<std::uint8_t>& is_word,
                 const Column<std::uint8_t>& centres, const Column<double>& weights) {
  const std::size_t count = check_descriptors(centres);
  for (const py::ssize_t size : {parents.size(), is_word.size(), weights.size()}) {
    if (static_cast<std::size_t>(size) != count) {
      throw VocabularyError("the columns of a node table must have the same length");
    }
  }
  return {count, parents.data(), is_word.data(), centres.data(), weights.data()};
}

std::shared_ptr<Vocabulary> unconst(std::shared_ptr<const Vocabulary> vocabulary) {
  return std::const_pointer_cast<Vocabulary>(std::move(vocabulary));
}

std::shared_ptr<Vocabulary> from_table(int branching, int depth, Scoring scoring,
                                       Weighting weighting, const Column<std::uint32_t>& parents,
                                       const Column<std::uint8_t>& is_word,
                                       const Column<std::uint8_t>& centres,
                                       const Column<double>& weights) {
  const NodeRows rows = to_rows(parents, is_word, centres, weights);
  const py::gil_scoped_release unlocked;
  return unconst(Vocabulary::from_rows(branching, depth, scoring, weighting, rows));
}

py::tuple node_table(const Vocabulary& vocabulary) {
  NodeTable columns;
  {
    const py::gil_scoped_release unlocked;
    columns = vocabulary.table();
  }
  return py::make_tuple(
      to_array(columns.parents), to_array(columns.is_word),
      copy_to_array<std::uint8_t>(columns.centres.data(),
                                  {static_cast<py::ssize_t>(columns.centres.size()), 32}),
      to_array(columns.weights));
}

py::tuple quantise(const Vocabulary& vocabulary, const Column<std::uint8_t>& rows) {
  const std::vector<Descriptor> descriptors = to_descriptors(rows);
  std::vector<std::uint32_t> words(descriptors.size()), nodes(descriptors.size());
  std::vector<double> weights(descriptors.size());
  {
    const py::gil_scoped_release unlocked;
    for (std::size_t i = 0; i < descriptors.size(); ++i) {
      const Quantised q = vocabulary.quantise(descriptors[i]);
      words[i] = q.word;
      nodes[i] = q.node;
      weights[i] = q.weight;
    }
  }
  return py::make_tuple(to_array(words), to_array(nodes), to_array(weights));
}

std::pair<WordVector, DirectIndex> transform(const Vocabulary& vocabulary,
                                             const Column<std::uint8_t>& rows) {
  const std::vector<Descriptor> descriptors = to_descriptors(rows);
  std::pair<WordVector, DirectIndex> result;
  const py::gil_scoped_release unlocked;
  vocabulary.transform(descriptors, result.first, result.second);
  return result;
}

std::shared_ptr<Vocabulary> train(const Column<std::uint8_t>& rows,
                                  const std::vector<std::size_t>& image_ends,
                                  const TrainingOptions& options, const py::object& progress) {
  const TrainingSet images{to_descriptors(rows), image_ends};
  const TrainingProgress listener = [&progress](double fraction) {
    const py::gil_scoped_acquire locked;
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
    // Only an explicit False cancels: most callbacks return nothing.
    return progress.is_none() || !progress(fraction).is(py::bool_(false));
  };
  const py::gil_scoped_release unlocked;
  return unconst(train_vocabulary(images, options, listener));
}

void bind_word_types(py::module_& module) {
  py::class_<WordVector>(module, "WordVector",
                         "Bag of words of an image: ascending word ids and their weights, which "
                         "sum to 1. Arrays are copies.")
      .def(py::init([](const std::vector<std::uint32_t>& words, std::vector<double> weights) {
             if (words.size() != weights.size()) {
               throw VocabularyError("a word vector needs as many weights as words");
             }
             return WordVector{words, std::move(weights)};
           }),
           py::arg("words"), py::arg("weights"))
      .def("__len__", [](const WordVector& v) { return v.words.size(); })
      .def_property_readonly(
          "words", [](const WordVector& v) { return to_array(v.words); }, "(m,) uint32.")
      .def_property_readonly(
          "weights", [](const WordVector& v) { return to_array(v.weights); }, "(m,) float64.");
  py::class_<DirectIndex>(module, "DirectIndex",
                          "Features of an image by vocabulary node: those of nodes[i] are "
                          "indices[offsets[i]:offsets[i + 1]]. Arrays are copies.")
      .def_property_readonly(
          "nodes", [](const DirectIndex& d) { return to_array(d.nodes); }, "(g,) uint32.")
      .def_property_readonly(
          "offsets", [](const DirectIndex& d) { return to_array(d.offsets); }, "(g + 1,) uint32.")
      .def_property_readonly(
          "indices", [](const DirectIndex& d) { return to_array(d.indices); }, "(k,) uint32.");
}

void bind_words(py::module_& module) {
  module.def("similarity", &similarity, py::arg("a"), py::arg("b"),
             "L1 score of two word vectors, 0 (disjoint) to 1 (identical).");
  module.def(
      "describe", [](Frame& frame, const Vocabulary& vocabulary) { describe(frame, vocabulary); },
      py::arg("frame"), py::arg("vocabulary"), py::call_guard<py::gil_scoped_release>(),
      "Computes words and direct index of a frame that no other thread uses yet; a second call "
      "does nothing.");
}

void bind_vocabulary_types(py::module_& module) {
  py::enum_<Scoring>(module, "Scoring", "How word vectors are compared; only L1 is computed.")
      .value("L1", Scoring::kL1)
      .value("L2", Scoring::kL2)
      .value("CHI_SQUARE", Scoring::kChiSquare)
      .value("KL", Scoring::kKl)
      .value("BHATTACHARYYA", Scoring::kBhattacharyya)
      .value("DOT_PRODUCT", Scoring::kDotProduct);
  py::enum_<Weighting>(module, "Weighting", "How the words of an image are weighted.")
      .value("TF_IDF", Weighting::kTfIdf)
      .value("TF", Weighting::kTf)
      .value("IDF", Weighting::kIdf)
      .value("BINARY", Weighting::kBinary);
  py::class_<VocabularySource>(module, "VocabularySource",
                               "The text file a binary vocabulary was made from.")
      .def(py::init([](std::uint64_t size, std::int64_t mtime_ns, std::uint64_t hash) {
             return VocabularySource{size, mtime_ns, hash};
           }),
           py::arg("size") = 0, py::arg("mtime_ns") = 0, py::arg("hash") = 0)
      .def_readonly("size", &VocabularySource::size, "Bytes.")
      .def_readonly("mtime_ns", &VocabularySource::mtime_ns, "Time of its last change [ns].")
      .def_readonly("hash", &VocabularySource::hash, "Hash of samples of its content.")
      .def("__eq__", [](const VocabularySource& a, const VocabularySource& b) {
        return a.size == b.size && a.mtime_ns == b.mtime_ns && a.hash == b.hash;
      });
  py::class_<TrainingOptions>(module, "TrainingOptions",
                              "How a vocabulary is trained; the defaults suit most uses.")
      .def(py::init<>())
      .def_readwrite("branching", &TrainingOptions::branching, "Children per node, 2 to 20.")
      .def_readwrite("depth", &TrainingOptions::depth, "Levels below the root, 1 to 10.")
      .def_readwrite("weighting", &TrainingOptions::weighting)
      .def_readwrite("seed", &TrainingOptions::seed)
      .def_readwrite("max_iterations", &TrainingOptions::max_iterations,
                     "Per k-means; 0: until an assignment repeats itself.")
      .def_readwrite("distance_power", &TrainingOptions::distance_power,
                     "Of the k-means++ seeding, 1 or 2.")
      .def_readwrite("minimum_weight", &TrainingOptions::minimum_weight,
                     "Words below it are stopped (weight 0).")
      .def_readwrite("n_threads", &TrainingOptions::n_threads,
                     "0: one per core, at most OMP_NUM_THREADS. The result does not depend "
                     "on it.")
      .def("check", &TrainingOptions::check, "Raises SettingsError when one is out of range.");
}

void bind_vocabulary_class(py::module_& module) {
  py::class_<Vocabulary, std::shared_ptr<Vocabulary>>(
      module, "Vocabulary",
      "A tree over ORB descriptors whose leaves are the visual words. Immutable; shared by threads "
      "and systems. See orbslam2py.vocabulary for reading any format.")
      .def_static(
          "open", [](const std::string& path) { return unconst(Vocabulary::open(path)); },
          py::arg("path"), py::call_guard<py::gil_scoped_release>(),
          "Maps a file in the binary format; its pages are shared between processes. Raises "
          "VocabularyError naming the path and what is wrong.")
      .def_static("from_table", &from_table, py::arg("branching"), py::arg("depth"),
                  py::arg("scoring"), py::arg("weighting"), py::arg("parents"), py::arg("is_word"),
                  py::arg("centres"), py::arg("weights"),
                  "From columns in text order, without the root: row i is node i + 1. parents (n,) "
                  "uint32, is_word (n,) uint8, centres (n, 32) uint8, weights (n,) float64. Raises "
                  "VocabularyError naming the first bad node.")
      .def("table", &node_table, "The columns (parents, is_word, centres, weights) of from_table.")
      .def(
          "save",
          [](const Vocabulary& v, const std::string& path, std::optional<std::string> comment,
             std::optional<VocabularySource> source) {
            v.save(path, comment.value_or(v.comment()), source.value_or(v.source()));
          },
          py::arg("path"), py::arg("comment") = py::none(), py::arg("source") = py::none(),
          py::call_guard<py::gil_scoped_release>(),
          "Writes the binary format under a temporary name, then renames. Comment and source are "
          "kept unless given. Raises VocabularyError.")
      .def_property_readonly("branching", &Vocabulary::branching)
      .def_property_readonly("depth", &Vocabulary::depth)
      .def_property_readonly("scoring", &Vocabulary::scoring)
      .def_property_readonly("weighting", &Vocabulary::weighting)
      .def(
          "sha256",
          [](const Vocabulary& v) {
            const py::object digest = py::module_::import("hashlib").attr("sha256")();
            for (const std::string_view piece : v.content()) {
              digest.attr("update")(py::memoryview::from_memory(
                  piece.data(), static_cast<py::ssize_t>(piece.size())));
            }
            return digest.attr("hexdigest")().cast<std::string>();
          },
          "SHA-256 of the content, 64 hexadecimal digits: parameters and tree, not the comment.")
      .def_property_readonly("n_nodes", &Vocabulary::n_nodes, "The root included.")
      .def_property_readonly("n_words", &Vocabulary::n_words)
      .def_property_readonly("hash", &Vocabulary::hash, "Of the content; maps remember it.")
      .def_property_readonly("comment", &Vocabulary::comment, "Where it comes from, its licence.")
      .def_property_readonly("source", &Vocabulary::source)
      .def("check_content", &Vocabulary::check_content, py::call_guard<py::gil_scoped_release>(),
           "Raises VocabularyError unless the whole content matches its hash.")
      .def("quantise", &quantise, py::arg("descriptors"),
           "Word, node of the direct index and weight of each descriptor: uint32, uint32, float64 "
           "arrays (n,). descriptors: (n, 32) uint8.")
      .def("transform", &transform, py::arg("descriptors"),
           "Word vector and direct index of an image. descriptors: (n, 32) uint8.");
}

void bind_keyframe_index(py::module_& module) {
  py::class_<PlaceCandidate>(module, "PlaceCandidate",
                             "A keyframe that may show the same place as the query.")
      .def_readonly("keyframe", &PlaceCandidate::keyframe)
      .def_readonly("common_words", &PlaceCandidate::common_words)
      .def_readonly("score", &PlaceCandidate::score, "L1 score with the query, 0 to 1.")
      .def_readonly("group_score", &PlaceCandidate::group_score,
                    "Sum of the scores of its group of covisible keyframes.");
  using unlocked = py::call_guard<py::gil_scoped_release>;
  py::class_<KeyFrameIndex, std::shared_ptr<KeyFrameIndex>>(
      module, "KeyFrameIndex",
      "Inverted file: which keyframes contain a word. Safe to use from several threads.")
      .def(py::init<>())
      .def("__len__", &KeyFrameIndex::size, unlocked())
      .def("__contains__", &KeyFrameIndex::contains, py::arg("id"), unlocked())
      .def("erase", &KeyFrameIndex::erase, py::arg("id"), unlocked(),
           "Forgets a keyframe; call it after its death in the map.")
      .def("clear", &KeyFrameIndex::clear, unlocked());
  module.def("index_keyframe", &index_keyframe, py::arg("index"), py::arg("map"), py::arg("id"),
             unlocked(), "Adds a living, described keyframe; a dead one is left out.");
  module.def("lowest_neighbour_score", &lowest_neighbour_score, py::arg("map"), py::arg("id"),
             unlocked(),
             "The lowest score of a keyframe with a covisible neighbour: a loop candidate must "
             "reach it. 1 without neighbours.");
  module.def("find_loop_candidates", &find_loop_candidates, py::arg("index"), py::arg("map"),
             py::arg("id"), py::arg("min_score"), unlocked(),
             "Keyframes not connected to this one that look like it, by ascending id; none when it "
             "has died.");
  module.def("find_relocalization_candidates", &find_relocalization_candidates, py::arg("index"),
             py::arg("map"), py::arg("frame"), unlocked(),
             "Keyframes that look like a described frame, by ascending id.");
}

}  // namespace

void bind_places(py::module_& module) {
  bind_word_types(module);
  bind_vocabulary_types(module);
  bind_vocabulary_class(module);
  bind_words(module);
  bind_keyframe_index(module);
  module.def(
      "find_problem",
      [](int branching, int depth, const Column<std::uint32_t>& parents,
         const Column<std::uint8_t>& is_word, const Column<std::uint8_t>& centres,
         const Column<double>& weights) -> std::optional<std::pair<std::size_t, std::string>> {
        const NodeRows rows = to_rows(parents, is_word, centres, weights);
        const py::gil_scoped_release unlocked;
        const auto problem = find_problem(branching, depth, rows);
        if (!problem) return std::nullopt;
        return std::make_pair(problem->node, problem->what);
      },
      py::arg("branching"), py::arg("depth"), py::arg("parents"), py::arg("is_word"),
      py::arg("centres"), py::arg("weights"),
      "The first node that breaks the rules of the tree and how, or None.");
  module.def("train_vocabulary", &train, py::arg("descriptors"), py::arg("image_ends"),
             py::arg("options"), py::arg("progress") = py::none(),
             "Hierarchical k-means over the descriptors of all training images, (n, 32) uint8, one "
             "image after the other; image_ends: one past the last descriptor of each image. "
             "progress(fraction) is called on this thread; returning False cancels, and None is "
             "returned. Raises SettingsError or VocabularyError.");
}

}  // namespace orbslam::bindings
