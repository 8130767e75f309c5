// Temporary folder of a test.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>

namespace carillon::tests {

/// Created empty; removed with its contents by the destructor.
class Folder {
 public:
  /// Below `parent`, by default the temporary folder.
  explicit Folder(const std::filesystem::path& parent = std::filesystem::temp_directory_path()) {
    std::string name = (parent / "carillon-test-XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr) throw std::filesystem::filesystem_error("no temporary folder", parent, {});
    path_ = name;
  }
  ~Folder() {
    std::error_code none;
    for (std::filesystem::recursive_directory_iterator it(path_, none), end; !none && it != end; it.increment(none)) {
      if (it->symlink_status(none).type() == std::filesystem::file_type::directory)
        std::filesystem::permissions(it->path(), std::filesystem::perms::owner_all, none);
    }
    std::filesystem::remove_all(path_, none);
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;

  std::filesystem::path operator/(const std::string& name) const { return path_ / name; }
  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path write(const std::string& name, std::string_view text) const {
    std::filesystem::create_directories((path_ / name).parent_path());
    std::ofstream(path_ / name, std::ios::binary) << text;
    return path_ / name;
  }

 private:
  std::filesystem::path path_;
};

inline std::string read_all(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

}  // namespace carillon::tests
