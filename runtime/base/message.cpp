#include "runtime/base/message.hpp"

#include <algorithm>
#include <cerrno>
#include <system_error>

#include "runtime/base/file.hpp"
#include "runtime/base/printable.hpp"

namespace carillon::base {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxWord = 600, kMaxText = 4000;
constexpr const char* kCut = "...";

bool is_continuation(char c) { return (static_cast<unsigned char>(c) & 0xC0U) == 0x80U; }

/// Keeps two thirds of `max` from the beginning and the rest from the end, at UTF-8 boundaries.
std::string cut_middle(std::string_view text, std::size_t max) {
  if (text.size() <= max) return std::string(text);
  std::size_t head = 2 * max / 3, tail = text.size() - (max - 2 * max / 3);
  while (head > 0 && is_continuation(text[head])) --head;
  while (tail < text.size() && is_continuation(text[tail])) ++tail;
  return std::string(text.substr(0, head)) + kCut + std::string(text.substr(tail));
}

}  // namespace

std::string shorten(std::string_view text) {
  std::string shorter;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find_first_of(" \n", at), text.size());
    shorter += cut_middle(text.substr(at, end - at), kMaxWord);
    if (end < text.size()) shorter += text[end];
    at = end + 1;
  }
  return cut_middle(shorter, kMaxText);
}

std::string show_message(std::string_view text) { return printable(shorten(text)); }

std::string find_name(const fs::path& file) {
  constexpr std::string_view kBegin = "/proc/self/fd/";
  std::string text = file.string();
  if (!text.starts_with(kBegin)) return text;
  const std::size_t slash = std::min(text.find('/', kBegin.size()), text.size());
  std::error_code error;
  const fs::path opened = fs::read_symlink(text.substr(0, slash), error);
  return error || !opened.is_absolute() ? text : opened.string() + text.substr(slash);
}

const char* find_advice(int error) {
  return error == EFBIG                           ? "files may not be so large here: raise the limit (ulimit -f)"
         : error == ENOLCK || error == EOPNOTSUPP ? "this file system keeps no locks: choose another folder"
         : is_full_error(error)                   ? "the disk or quota is full: make room on it"
                                                  : "check the folder's rights and the space on the disk";
}

}  // namespace carillon::base
