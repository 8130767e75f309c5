// Lines of fixed columns in files of results.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <unordered_map>
#include <utility>
#include <vector>

#include "runtime/base/failure.hpp"
#include "runtime/base/fields.hpp"
#include "runtime/base/printable.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::exchange {

/// Factors of dataset 164 of universal files: units per metre and per newton (1: not given).
struct FileUnits {
  double per_metre = 1.0, per_newton = 1.0;
};

inline constexpr std::size_t kMaxResultNodes = 50'000'000, kMaxResultModes = 40'000;

/// Reads lines and their columns. Errors are InputError "name:line: ...".
class ResultsLines {
 public:
  ResultsLines(std::string_view bytes, const std::string& name) : bytes_(bytes), name_(name) {}

  bool is_at_end() const { return at_ >= bytes_.size(); }

  template <class... Args>
  [[noreturn]] void fail(fmt::format_string<Args...> format, Args&&... args) const {
    throw PlacedError(fmt::format("{}:{}", name_, line_number_), fmt::format(format, std::forward<Args>(args)...));
  }

  /// The next line, in `block` for the message at the end of the file.
  std::string_view next(const char* block) {
    if (is_at_end()) fail("the file ends within {}; it was cut short: write or copy it again", block);
    const std::size_t end = std::min(bytes_.find('\n', at_), bytes_.size());
    std::string_view line = bytes_.substr(at_, end - at_);
    at_ = end + 1;
    ++line_number_;
    if (line.ends_with('\r')) line.remove_suffix(1);
    return line;
  }

  /// Dataset 164, from its second line on. Later lines of it remain.
  FileUnits read_units() {
    (void)next("the units");
    const std::string_view factors = next("the units");
    FileUnits units{number<double>(factors, 0, 25, "the factor of lengths"), 1.0};
    if (!cut(factors, 25, 25).empty()) units.per_newton = number<double>(factors, 25, 25, "the factor of forces");
    if (!is_factor(units.per_metre)) fail("the factor of lengths is {:g}; it has to be units per metre, 1000 for mm", units.per_metre);
    if (!is_factor(units.per_newton)) fail("the factor of forces is {:g}; it has to be units per newton", units.per_newton);
    return units;
  }

  std::size_t remaining() const { return bytes_.size() - std::min(at_, bytes_.size()); }

  /// The next `count` bytes, which are no text.
  std::string_view take(std::size_t count, const char* block) {
    if (count > remaining()) fail("the file ends within {}; it was cut short: write or copy it again", block);
    at_ += count;
    return bytes_.substr(at_ - count, count);
  }

  /// Columns `begin` to `begin + width`, without blanks around them.
  static std::string_view cut(std::string_view line, std::size_t begin, std::size_t width) {
    std::string_view field = begin < line.size() ? line.substr(begin, width) : std::string_view();
    while (!field.empty() && field.front() == ' ') field.remove_prefix(1);
    while (!field.empty() && field.back() == ' ') field.remove_suffix(1);
    return field;
  }

  /// A number in such columns, as base::find_real and find_int read it.
  template <class T>
  T number(std::string_view line, std::size_t begin, std::size_t width, const char* what) const {
    const std::string_view field = cut(line, begin, width);
    if constexpr (std::is_floating_point_v<T>) {
      if (const auto value = base::find_real(field)) return *value;
    } else {
      if (const auto value = base::find_int(field); value && std::in_range<T>(*value)) return static_cast<T>(*value);
    }
    fail("expected {}, found '{}'; the file is damaged: write it again", what, base::printable(field));
  }

  /// Three finite numbers.
  Vec3 vector(std::string_view line, std::size_t begin, std::size_t width, const char* what) const {
    Vec3 x{};
    for (std::size_t k = 0; k < 3; ++k) {
      x[k] = number<double>(line, begin + width * k, width, what);
      if (!std::isfinite(x[k])) fail("{} is not finite; correct the model and solve it again", what);
    }
    return x;
  }

 private:
  static bool is_factor(double x) { return x > 1e-6 && x < 1e9; }

  std::string_view bytes_;
  const std::string& name_;
  std::size_t at_ = 0, line_number_ = 0;
};

/// Nodes by their numbers in the file. `Lines` throws the errors.
template <class Lines>
class ResultsNodes {
 public:
  explicit ResultsNodes(const Lines& lines) : lines_(lines) {}

  void add(std::int64_t tag, const Vec3& position, std::vector<Vec3>& nodes) {
    if (nodes.size() >= kMaxResultNodes) lines_.fail("more than {} nodes", kMaxResultNodes);
    if (!index_of_.try_emplace(tag, nodes.size()).second) lines_.fail("node {} is defined a second time; write the file again", tag);
    nodes.push_back(position);
  }
  std::optional<std::size_t> look_up(std::int64_t tag) const {
    const auto found = index_of_.find(tag);
    return found == index_of_.end() ? std::nullopt : std::optional(found->second);
  }
  std::size_t find(std::int64_t tag) const {
    const auto found = look_up(tag);
    if (!found) lines_.fail("node {} is not among the nodes of the file; write it again", tag);
    return *found;
  }

 private:
  const Lines& lines_;
  std::unordered_map<std::int64_t, std::size_t> index_of_;
};

}  // namespace carillon::exchange
