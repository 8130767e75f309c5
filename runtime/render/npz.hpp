// Arrays as a NumPy archive (.npz): a ZIP file of .npy files, uncompressed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

namespace carillon::render {

/// Writes arrays one after the other; numpy.load() reads the file. Throws InputError for 4 GiB or more.
class NpzWriter {
 public:
  /// `sink` receives the bytes in order.
  explicit NpzWriter(std::function<void(std::string_view)> sink) : sink_(std::move(sink)) {}

  /// An array in C order: `type` as NumPy writes it ("<f8"), `bytes` of all its elements.
  void add(const std::string& name, const std::string& type, const std::vector<std::size_t>& shape, std::string_view bytes);
  /// The directory of the archive; nothing may follow.
  void finish();

 private:
  void put(std::string_view bytes);

  std::function<void(std::string_view)> sink_;
  std::uint64_t written_ = 0;
  std::string directory_;
  int files_ = 0;
};

}  // namespace carillon::render
