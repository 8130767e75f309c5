// Reads text surfaces line by line and checks their numbers; std only.
#include "precompute/mesher/scan_text.hpp"

#include <fmt/core.h>

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <optional>
#include <sstream>
#include <vector>

#include "runtime/config/error.hpp"

namespace carillon::mesher {
namespace {

constexpr double kLargest = 1e30;

/// The lines of a file, with the place for messages.
class Lines {
 public:
  explicit Lines(const std::filesystem::path& path) : path_(path), in_(path, std::ios::binary) {}

  bool next(std::vector<std::string>& words, bool comments) {
    std::string line;
    words.clear();
    if (!std::getline(in_, line)) return false;
    ++number_;
    if (comments) line = line.substr(0, line.find('#'));
    std::istringstream stream(line);
    for (std::string word; stream >> word;) words.push_back(word);
    return true;
  }

  [[noreturn]] void refuse(const std::string& what) const { refuse(number_, what); }
  [[noreturn]] void refuse(std::int64_t line, const std::string& what) const {
    throw InputError(fmt::format("{}: line {}: {}", path_.string(), line, what));
  }

  void check_coordinate(const std::string& word) const {
    char* end = nullptr;
    const double value = std::strtod(word.c_str(), &end);
    if (end == word.c_str() || *end != '\0' || !(std::abs(value) <= kLargest))
      refuse(fmt::format("the coordinate '{}' must be a finite number below 1e30; export the surface again", word.substr(0, 40)));
  }

  std::int64_t number() const { return number_; }

 private:
  std::filesystem::path path_;
  std::ifstream in_;
  std::int64_t number_ = 0;
};

/// The whole number at the start of a word like 12 or 12/3/4; nothing if there is none or it has more than 18 digits.
std::optional<std::int64_t> read_index(const std::string& word) {
  char* end = nullptr;
  const long long value = std::strtoll(word.c_str(), &end, 10);
  if (end == word.c_str() || (*end != '\0' && *end != '/') || end - word.c_str() > 18) return std::nullopt;
  return value;
}

void scan_obj(Lines& lines) {
  std::vector<std::string> words;
  std::int64_t vertices = 0, largest = 0, line_of_largest = 0;
  while (lines.next(words, true)) {
    if (words.empty()) continue;
    if (words[0] == "v") {
      if (words.size() < 4) lines.refuse("a vertex has fewer than three coordinates; export the surface again");
      for (int c = 1; c <= 3; ++c) lines.check_coordinate(words[c]);
      ++vertices;
    } else if (words[0] == "f") {
      for (std::size_t c = 1; c < words.size() && words[c] != "\\"; ++c) {
        const auto index = read_index(words[c]);
        if (!index || *index == 0 || *index < -vertices)
          lines.refuse(
              fmt::format("the face names the vertex '{}', which does not exist ({} were given before it); export the surface again",
                          words[c].substr(0, 40), vertices));
        if (*index > largest) largest = *index, line_of_largest = lines.number();
      }
    }
  }
  if (largest > vertices && vertices > 0)
    lines.refuse(line_of_largest,
                 fmt::format("the face names vertex {}, but there are only {}; export the surface again", largest, vertices));
}

void scan_off(Lines& lines) {
  std::vector<std::string> words;
  std::vector<std::string> start;
  // The word OFF and three counts may share lines.
  while (start.size() < 4 && lines.next(words, true)) {
    if (start.empty() && !words.empty() && (words[0] != "OFF" || (words.size() > 1 && words[1] == "BINARY"))) return;
    start.insert(start.end(), words.begin(), words.end());
  }
  if (start.size() != 4) return;
  const auto vertices = read_index(start[1]), faces = read_index(start[2]);
  if (!vertices || !faces) return;
  for (std::int64_t v = 0; v < *vertices;) {
    if (!lines.next(words, true))
      lines.refuse(fmt::format("the file ends after {} of {} vertices; it is cut off, export it again", v, *vertices));
    if (words.empty()) continue;
    if (words.size() < 3) return;  // another layout: left to the reader
    for (int c = 0; c < 3; ++c) lines.check_coordinate(words[c]);
    ++v;
  }
  for (std::int64_t f = 0; f < *faces;) {
    if (!lines.next(words, true))
      lines.refuse(fmt::format("the file ends after {} of {} faces; it is cut off, export it again", f, *faces));
    if (words.empty()) continue;
    const auto corners = read_index(words[0]);
    if (!corners || *corners < 1 || *corners + 1 > static_cast<std::int64_t>(words.size()))
      lines.refuse(
          fmt::format("the face promises '{}' corners and has {}; export the surface again", words[0].substr(0, 40), words.size() - 1));
    for (std::int64_t c = 1; c <= *corners; ++c) {
      const auto index = read_index(words[static_cast<std::size_t>(c)]);
      if (!index || *index < 0 || *index >= *vertices)
        lines.refuse(fmt::format("the face names the vertex '{}', which does not exist (0 to {} do); export the surface again",
                                 words[static_cast<std::size_t>(c)].substr(0, 40), *vertices - 1));
    }
    ++f;
  }
}

void scan_ply(Lines& lines) {
  std::vector<std::string> words;
  struct Element {
    std::string name;
    std::int64_t count = 0;
    std::vector<std::string> properties;  // scalar ones, "" for a list
  };
  std::vector<Element> elements;
  bool ended = false;
  while (!ended && lines.next(words, false)) {
    if (words.empty()) continue;
    if (words[0] == "format" && words.size() > 1) {
      if (words[1].rfind("binary_", 0) == 0) return;
      if (words[1] != "ascii") lines.refuse(fmt::format("unknown format '{}'; a PLY file is ascii or binary", words[1].substr(0, 40)));
    }
    if (words[0] == "element" && words.size() > 2) elements.push_back({words[1], read_index(words[2]).value_or(0), {}});
    if (words[0] == "property" && words.size() > 2 && !elements.empty())
      elements.back().properties.push_back(words[1] == "list" ? "" : words.back());
    ended = words[0] == "end_header";
  }
  if (!ended) lines.refuse("the header has no end_header; the file is cut off, export it again");
  std::int64_t vertices = 0;
  for (const Element& element : elements) {
    if (element.name == "vertex") vertices = element.count;
    for (std::int64_t n = 0; n < element.count;) {
      if (!lines.next(words, false))
        lines.refuse(
            fmt::format("the file ends after {} of {} of its element {}; it is cut off, export it again", n, element.count, element.name));
      if (words.empty()) continue;
      ++n;
      if (element.name == "vertex") {
        for (std::size_t c = 0; c < element.properties.size() && c < words.size(); ++c)
          if (element.properties[c] == "x" || element.properties[c] == "y" || element.properties[c] == "z")
            lines.check_coordinate(words[c]);
      } else if (element.name == "face" && element.properties.size() == 1 && element.properties[0].empty()) {
        const auto corners = read_index(words[0]);
        if (!corners || *corners < 0 || *corners + 1 != static_cast<std::int64_t>(words.size()))
          lines.refuse(
              fmt::format("the face promises '{}' corners and has {}; export the surface again", words[0].substr(0, 40), words.size() - 1));
        for (std::size_t c = 1; c < words.size(); ++c) {
          const auto index = read_index(words[c]);
          if (!index || *index < 0 || *index >= vertices)
            lines.refuse(fmt::format("the face names the vertex '{}', which does not exist (0 to {} do); export the surface again",
                                     words[c].substr(0, 40), vertices - 1));
        }
      }
    }
  }
}

void scan_stl(Lines& lines) {
  std::vector<std::string> words;
  if (!lines.next(words, false) || words.empty() || words[0] != "solid") return;
  while (lines.next(words, false)) {
    if (words.empty() || words[0] != "vertex") continue;
    if (words.size() != 4) return;  // a binary file whose header begins with solid
    for (int c = 1; c <= 3; ++c) lines.check_coordinate(words[c]);
  }
}

}  // namespace

void scan_text(const std::filesystem::path& path, const std::string& format) {
  Lines lines(path);
  if (format == "obj") scan_obj(lines);
  if (format == "off") scan_off(lines);
  if (format == "ply") scan_ply(lines);
  if (format == "stl") scan_stl(lines);
}

}  // namespace carillon::mesher
