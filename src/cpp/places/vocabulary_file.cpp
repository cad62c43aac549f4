// SPDX-License-Identifier: BSD-3-Clause
#include "places/vocabulary_file.hpp"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <new>

#include "base/errors.hpp"

namespace orbslam {
namespace {

constexpr char kMagic[4] = {'B', 'V', 'O', 'C'};
constexpr std::uint32_t kVersion = 1;
constexpr std::uint32_t kEndianTag = 0x01020304;
constexpr std::uint64_t kAlignment = 64;
// Node numbers are 32 bits wide and a descriptor has 32 bytes, so sizes cannot overflow.
constexpr std::uint64_t kMaxNodes = std::uint64_t{1} << 31;

std::uint64_t align(std::uint64_t offset) {
  return (offset + kAlignment - 1) / kAlignment * kAlignment;
}

/// Offsets and total size as they must be for these numbers of nodes, words and comment bytes.
void lay_out(VocabularyHeader& header) {
  std::uint64_t end = sizeof(VocabularyHeader);
  const auto place = [&](std::uint64_t bytes) {
    const std::uint64_t begin = align(end);
    end = begin + bytes;
    return begin;
  };
  header.centres = place(header.n_nodes * sizeof(Descriptor));
  header.child_count = place(header.n_nodes);
  header.link = place(header.n_nodes * sizeof(std::uint32_t));
  header.original_id = place(header.n_nodes * sizeof(std::uint32_t));
  header.weight = place(header.n_words * sizeof(double));
  header.comment = place(header.comment_size);
  header.total_size = end;
}

std::uint64_t header_hash(const VocabularyHeader& header) {
  return hash_bytes(&header, offsetof(VocabularyHeader, header_hash), 0);
}

std::string reason() { return std::strerror(errno); }

[[noreturn]] void fail(const std::string& name, const std::string& what) {
  throw VocabularyError(name + ": " + what);
}

/// Closes the file, and removes it unless it was kept.
class TemporaryFile {
 public:
  explicit TemporaryFile(const std::string& final_path)
      : final_path_(final_path), path_(final_path + ".part" + std::to_string(::getpid())) {
    file_ = std::fopen(path_.c_str(), "wb");
    if (file_ == nullptr) fail(final_path_, "cannot be written: " + reason());
  }
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;
  ~TemporaryFile() {
    if (file_ != nullptr) std::fclose(file_);
    if (!kept_) std::remove(path_.c_str());
  }

  void write(const void* data, std::size_t size) {
    if (size > 0 && std::fwrite(data, 1, size, file_) != size) {
      fail(final_path_, "writing failed: " + reason());
    }
  }
  void keep() {
    std::FILE* file = file_;
    file_ = nullptr;
    if (std::fclose(file) != 0) fail(final_path_, "writing failed: " + reason());
    if (std::rename(path_.c_str(), final_path_.c_str()) != 0) {
      fail(final_path_, "cannot be replaced: " + reason());
    }
    kept_ = true;
  }

 private:
  std::string final_path_, path_;
  std::FILE* file_ = nullptr;
  bool kept_ = false;
};

}  // namespace

std::uint64_t hash_bytes(const void* data, std::size_t size, std::uint64_t seed) {
  constexpr std::uint64_t kMultiplier = 0x9e3779b97f4a7c15ULL;
  std::uint64_t hash = seed ^ (size * kMultiplier);
  const auto mix = [&hash](std::uint64_t word) {
    hash = (hash ^ word) * kMultiplier;
    hash ^= hash >> 29;
  };
  const auto* bytes = static_cast<const unsigned char*>(data);
  std::uint64_t word = 0;
  for (; size >= sizeof word; bytes += sizeof word, size -= sizeof word) {
    std::memcpy(&word, bytes, sizeof word);
    mix(word);
  }
  if (size > 0) {
    word = 0;
    std::memcpy(&word, bytes, size);
    mix(word);
  }
  return hash ^ (hash >> 32);
}

VocabularyImage VocabularyImage::allocate(std::uint64_t n_nodes, std::uint64_t n_words) {
  VocabularyHeader header{};
  std::memcpy(header.magic, kMagic, sizeof kMagic);
  header.version = kVersion;
  header.endian_tag = kEndianTag;
  header.descriptor_bytes = sizeof(Descriptor);
  header.n_nodes = n_nodes;
  header.n_words = n_words;
  lay_out(header);

  VocabularyImage image;
  image.size_ = header.total_size;
  auto* memory =
      static_cast<std::byte*>(::operator new (header.total_size, std::align_val_t{kAlignment}));
  image.data_ = std::shared_ptr<const std::byte>(memory, [](const std::byte* p) {
    ::operator delete (const_cast<std::byte*>(p), std::align_val_t{kAlignment});
  });
  std::memset(memory, 0, header.total_size);
  std::memcpy(memory, &header, sizeof header);
  return image;
}

VocabularyImage VocabularyImage::map(const std::string& path) {
  const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) fail(path, "cannot be opened: " + reason());
  struct stat status {};
  const bool regular = ::fstat(file, &status) == 0 && S_ISREG(status.st_mode);
  const auto size = static_cast<std::size_t>(status.st_size);
  if (!regular || size < sizeof(VocabularyHeader)) {
    ::close(file);
    fail(path, regular ? "too short for a binary vocabulary" : "not a file");
  }
  void* memory = ::mmap(nullptr, size, PROT_READ, MAP_SHARED, file, 0);
  const std::string map_reason = reason();
  ::close(file);
  if (memory == MAP_FAILED) fail(path, "cannot be mapped into memory: " + map_reason);

  VocabularyImage image;
  image.size_ = size;
  image.data_ = std::shared_ptr<const std::byte>(
      static_cast<const std::byte*>(memory),
      [size](const std::byte* p) { ::munmap(const_cast<std::byte*>(p), size); });
  return image;
}

std::string VocabularyImage::comment() const {
  const VocabularyHeader& h = header();
  return {reinterpret_cast<const char*>(data() + h.comment), h.comment_size};
}

std::uint64_t VocabularyImage::content_hash() const {
  const VocabularyHeader& h = header();
  const std::uint64_t seed = hash_bytes(&h.branching, 4 * sizeof(std::uint32_t), h.n_nodes);
  return hash_bytes(data() + h.centres, h.weight + h.n_words * sizeof(double) - h.centres, seed);
}

void VocabularyImage::seal() {
  VocabularyHeader& h = edit_header();
  h.content_hash = content_hash();
  h.comment_hash = hash_bytes(data() + h.comment, h.comment_size, 0);
  h.header_hash = header_hash(h);
}

void VocabularyImage::check(const std::string& name) const {
  check_header(name);
  check_tree(name);
  if (size() <= kSmallFile) check_content(name);
}

void VocabularyImage::check_header(const std::string& name) const {
  const VocabularyHeader& h = header();
  if (std::memcmp(h.magic, kMagic, sizeof kMagic) != 0) fail(name, "not a binary vocabulary");
  if (h.endian_tag != kEndianTag || h.descriptor_bytes != sizeof(Descriptor)) {
    fail(name, "written for another byte order or descriptor; convert it again");
  }
  if (h.version != kVersion) {
    fail(name, "format version " + std::to_string(h.version) + ", this program reads version " +
                   std::to_string(kVersion) + "; convert it again");
  }
  if (h.header_hash != header_hash(h)) fail(name, "damaged header; copy or convert it again");
  if (h.total_size != size()) {
    fail(name, std::to_string(size()) + " bytes, expected " + std::to_string(h.total_size) +
                   "; the file is incomplete");
  }
  // A matching checksum is not enough: the offsets must agree with the sizes.
  const bool plausible = h.n_nodes >= 2 && h.n_nodes <= kMaxNodes && h.n_words >= 1 &&
                         h.n_words < h.n_nodes && h.comment_size <= size();
  VocabularyHeader expected = h;
  if (plausible) lay_out(expected);
  if (!plausible || std::memcmp(&expected, &h, sizeof h) != 0) {
    fail(name, "inconsistent sizes in the header");
  }
  if (h.branching < 2 || h.branching > 20 || h.depth < 1 || h.depth > 10 || h.scoring > 5 ||
      h.weighting > 3) {
    fail(name, "tree parameters out of range");
  }
}

void VocabularyImage::check_tree(const std::string& name) const {
  const VocabularyHeader& h = header();
  const std::uint8_t* counts = child_count();
  const std::uint32_t* links = link();
  std::uint64_t next_child = 1, n_leaves = 0, level_end = 1;
  std::uint32_t level = 0;
  bool good = true;
  for (std::uint64_t node = 0; node < h.n_nodes && good; ++node) {
    if (node == level_end) {
      level_end = next_child;
      ++level;
    }
    if (counts[node] == 0) {
      ++n_leaves;
      good = links[node] < h.n_words && node > 0;
    } else {
      good = links[node] == next_child && counts[node] <= h.branching && level < h.depth;
      next_child += counts[node];
    }
    // A node without a parent ends the numbering too early.
    good = good && node < next_child;
  }
  if (!good || next_child != h.n_nodes || n_leaves != h.n_words) {
    fail(name, "the tree is inconsistent; copy or convert the file again");
  }
}

void VocabularyImage::check_content(const std::string& name) const {
  const VocabularyHeader& h = header();
  if (content_hash() != h.content_hash ||
      hash_bytes(data() + h.comment, h.comment_size, 0) != h.comment_hash) {
    fail(name, "checksum mismatch, the content is damaged; copy or convert the file again");
  }
  const double* weights = weight();
  const bool usable = std::all_of(weights, weights + h.n_words,
                                  [](double w) { return std::isfinite(w) && w >= 0; });
  if (!usable) fail(name, "a word has a weight that is negative or not finite");
}

void write_vocabulary(const VocabularyImage& image, const std::string& path,
                      const std::string& comment, const VocabularySource& source) {
  VocabularyHeader header = image.header();
  header.comment_size = comment.size();
  header.source = source;
  lay_out(header);
  header.comment_hash = hash_bytes(comment.data(), comment.size(), 0);
  header.header_hash = header_hash(header);

  TemporaryFile file(path);
  file.write(&header, sizeof header);
  file.write(image.data() + sizeof header, header.comment - sizeof header);
  file.write(comment.data(), comment.size());
  file.keep();
}

}  // namespace orbslam
