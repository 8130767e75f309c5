// Tokens of text formats, and the text-only formats OBJ (only v and f) and OFF (3 coordinates, text).
// Source: Wavefront, "Object Files (.obj)", Advanced Visualizer manual, appendix B1 (v, f, negative references, continued lines); Geomview
//   manual, "OFF Files".
#include "precompute/mesher/surface_text.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdlib>

#include "precompute/mesh/cursor.hpp"

namespace carillon::mesher {

using mesh::quote_excerpt;

namespace {

bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\v' || c == '\f'; }

/// Corner of an OBJ face: the number before the first slash, from 1; negative: back from the last vertex.
std::optional<std::int64_t> read_reference(std::string_view word, std::int64_t vertices) {
  const auto index = read_whole(word.substr(0, word.find('/')));
  if (!index || *index == 0 || *index < -vertices) return std::nullopt;
  return *index > 0 ? *index - 1 : vertices + *index;
}

}  // namespace

bool SurfaceText::next(std::vector<std::string_view>& words) {
  words.clear();
  if (at_ >= bytes_.size()) return false;
  ++number_;
  bool commented = false;
  std::size_t begin = at_;
  const auto end_word = [&] {
    if (!commented && at_ > begin) words.push_back(bytes_.substr(begin, at_ - begin));
  };
  for (; at_ < bytes_.size(); ++at_) {
    const char c = bytes_[at_];
    if (c == '\n' || c == '\r') break;
    if (is_blank(c)) {
      end_word();
      begin = at_ + 1;
    } else if (comment_ != '\0' && c == comment_ && !commented) {
      end_word();
      commented = true;
    }
  }
  end_word();
  if (at_ < bytes_.size()) at_ += bytes_[at_] == '\r' && at_ + 1 < bytes_.size() && bytes_[at_ + 1] == '\n' ? 2 : 1;
  return true;
}

bool SurfaceText::next_filled(std::vector<std::string_view>& words) {
  while (next(words))
    if (!words.empty()) return true;
  return false;
}

std::optional<std::int64_t> read_whole(std::string_view word) {
  if (word.size() > 1 && word[0] == '+') word.remove_prefix(1);
  std::int64_t value = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc{} || end != word.data() + word.size()) return std::nullopt;
  return value;
}

std::optional<double> read_number(std::string_view word) {
  if (word.size() > 1 && word[0] == '+') word.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (end != word.data() + word.size()) return std::nullopt;
  if (error == std::errc::result_out_of_range) return std::strtod(std::string(word).c_str(), nullptr);
  if (error != std::errc{}) return std::nullopt;
  return value;
}

double SurfaceText::read_coordinate(std::string_view word) const {
  const auto value = read_number(word);
  if (!value || !(std::abs(*value) <= kLargestCoordinate))
    refuse("the coordinate {} must be a finite number below 1e30; export the surface again", quote_excerpt(word));
  return *value;
}

PolygonSoup parse_obj(std::string_view bytes, const std::string& name) {
  SurfaceText text(bytes, name, '#');
  PolygonSoup soup;
  std::vector<std::string_view> words, more;
  std::int64_t largest = -1, line_of_largest = 0;
  while (text.next(words)) {
    // A backslash at the end continues a line.
    while (!words.empty() && words.back() == "\\") {
      words.pop_back();
      if (!text.next(more)) break;
      words.insert(words.end(), more.begin(), more.end());
    }
    if (words.empty()) continue;
    const auto vertices = static_cast<std::int64_t>(soup.points.size());
    if (words[0] == "v") {
      if (words.size() < 4) text.refuse("a vertex has fewer than three coordinates; export the surface again");
      if (vertices >= kMaxPoints) text.refuse("more than {} vertices are too many; reduce the surface first", kMaxPoints);
      soup.points.push_back({text.read_coordinate(words[1]), text.read_coordinate(words[2]), text.read_coordinate(words[3])});
    } else if (words[0] == "f") {
      for (std::size_t c = 1; c < words.size(); ++c) {
        const auto index = read_reference(words[c], vertices);
        if (!index || *index > kMaxPoints)
          text.refuse("the face names the vertex {}, which does not exist ({} were given before it); export the surface again",
                      quote_excerpt(words[c]), vertices);
        if (*index > largest) largest = *index, line_of_largest = text.number();
        if (words.size() > 3) soup.corners.push_back(static_cast<std::int32_t>(*index));
      }
      if (words.size() > 3) soup.counts.push_back(static_cast<std::int32_t>(words.size() - 1));
    }
  }
  if (largest >= static_cast<std::int64_t>(soup.points.size()))
    text.refuse_line(line_of_largest, fmt::format("the face names vertex {}, but there are only {}; export the surface again", largest + 1,
                                                  soup.points.size()));
  return soup;
}

PolygonSoup parse_off(std::string_view bytes, const std::string& name) {
  SurfaceText text(bytes, name, '#');
  PolygonSoup soup;
  std::vector<std::string_view> words;
  if (!text.next_filled(words)) text.refuse("the file holds only blanks and comments; export it again");
  // The word is optional, and the counts may follow on the same line.
  std::string_view kind = "OFF";
  if (!read_whole(words[0])) {
    kind = words[0];
    words.erase(words.begin());
    std::string_view prefix = kind;
    for (const std::string_view part : {"ST", "C", "N"})
      if (prefix.starts_with(part)) prefix.remove_prefix(part.size());
    if (prefix == "4OFF" || prefix == "nOFF" || prefix == "4nOFF")
      text.refuse("{}: points of other than three coordinates are no surface in space; export it as plain OFF", quote_excerpt(kind));
    if (prefix != "OFF") text.refuse("found {} where OFF should be; this is no OFF file", quote_excerpt(kind));
    if (!words.empty() && words[0] == "BINARY") text.refuse("binary OFF is not read; export it as text, or as binary PLY or STL");
    if (words.empty() && !text.next_filled(words)) text.refuse("the file ends before its counts; it is cut off, export it again");
  }
  if (words.size() < 2) text.refuse("the numbers of vertices and faces should stand here; export the surface again");
  std::int64_t counts[2] = {0, 0};
  for (int n = 0; n < 2; ++n) {
    const char* what = n == 0 ? "vertices" : "faces";
    const auto count = read_whole(words[n]);
    if (!count) text.refuse("found {} where the number of {} should be; export the surface again", quote_excerpt(words[n]), what);
    // A vertex takes at least six bytes ("0 0 0
    // "), a face two.
    const std::int64_t max = std::min(static_cast<std::int64_t>(bytes.size()) / (n == 0 ? 5 : 2) + 1, kMaxPoints);
    if (*count < 0 || *count > max)
      text.refuse("the header promises {} {}, but the file has only {} bytes; it is cut off or damaged, export it again", *count, what,
                  bytes.size());
    counts[n] = *count;
  }
  soup.points.reserve(counts[0]);
  for (std::int64_t v = 0; v < counts[0]; ++v) {
    if (!text.next_filled(words)) text.refuse("the file ends after {} of {} vertices; it is cut off, export it again", v, counts[0]);
    if (words.size() < 3) text.refuse("a vertex has fewer than three coordinates; export the surface again, one vertex to a line");
    soup.points.push_back({text.read_coordinate(words[0]), text.read_coordinate(words[1]), text.read_coordinate(words[2])});
  }
  for (std::int64_t f = 0; f < counts[1]; ++f) {
    if (!text.next_filled(words)) text.refuse("the file ends after {} of {} faces; it is cut off, export it again", f, counts[1]);
    const auto corners = read_whole(words[0]);
    if (!corners || *corners < 1 || *corners >= static_cast<std::int64_t>(words.size()))
      text.refuse("the face promises {} corners and has {}; export the surface again", quote_excerpt(words[0]), words.size() - 1);
    for (std::size_t c = 1; c <= static_cast<std::size_t>(*corners); ++c) {
      const auto index = read_whole(words[c]);
      if (!index || *index < 0 || *index >= counts[0])
        text.refuse("the face names the vertex {}, which does not exist (0 to {} do); export the surface again", quote_excerpt(words[c]),
                    counts[0] - 1);
      if (*corners >= 3) soup.corners.push_back(static_cast<std::int32_t>(*index));
    }
    if (*corners >= 3) soup.counts.push_back(static_cast<std::int32_t>(*corners));
  }
  return soup;
}

}  // namespace carillon::mesher
