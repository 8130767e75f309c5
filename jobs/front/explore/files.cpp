#include "jobs/front/explore/files.hpp"

#include <fmt/core.h>
#include <zlib.h>

#include <cctype>
#include <cerrno>
#include <system_error>

#include "jobs/front/explore/names.hpp"
#include "runtime/base/file.hpp"

namespace carillon::explore {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void refuse(const fs::path& file, const std::error_code& error) {
  throw SystemError(fmt::format("{}: {}; make room, or choose another place", file.string(), error.message()));
}

}  // namespace

std::string make_name(std::string_view text) {
  std::string name;
  for (const char c : text) name += std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '.' || c == '_' ? c : '-';
  return cut_name(name.empty() || name[0] == '.' ? "body" + name : name);
}

std::string to_text(const base::Json& value) { return value.sorted_text({.indentation = " ", .is_ascii = false}) + "\n"; }

void put_file(const fs::path& from, const fs::path& to) {
  std::error_code error;
  fs::copy_file(from, to, error);
  if (error) refuse(to, error);
}

void put_folder(const fs::path& from, const fs::path& to) {
  std::error_code error;
  fs::create_directories(to, error);
  if (!error) fs::copy(from, to, fs::copy_options::recursive, error);
  if (error) refuse(to, error);
}

void compress_file(const fs::path& file) {
  const fs::path target = file.string() + ".gz";
  const gzFile out = ::gzopen(target.c_str(), "wb6");
  if (out == nullptr) refuse(target, std::error_code(errno, std::generic_category()));
  bool is_whole = true;
  try {
    base::read_pieces(file, "contacts file", 1 << 20, [&](std::string_view piece) {
      is_whole = is_whole && ::gzwrite(out, piece.data(), static_cast<unsigned>(piece.size())) == static_cast<int>(piece.size());
    });
  } catch (...) {
    ::gzclose(out);
    throw;
  }
  is_whole = ::gzclose(out) == Z_OK && is_whole;
  if (!is_whole) refuse(target, std::make_error_code(std::errc::no_space_on_device));
  std::error_code error;
  fs::remove(file, error);
}

std::uintmax_t calc_bytes(const fs::path& folder) {
  std::uintmax_t bytes = 0;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder))
    if (entry.is_regular_file()) bytes += entry.file_size();
  return bytes;
}

}  // namespace carillon::explore
