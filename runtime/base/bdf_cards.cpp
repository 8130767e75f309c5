// Source: MSC Nastran quick reference guide, "Format of bulk data entries".
#include "runtime/base/bdf_cards.hpp"

#include <algorithm>

#include "runtime/base/fields.hpp"

namespace carillon::base {
namespace {

constexpr std::size_t kNameWidth = 8, kDataEnd = 72, kFieldsOfLine = 8, kLargeFieldsOfLine = 4;

bool is_continuation(std::string_view field) { return field.empty() || field[0] == '+' || field[0] == '*'; }

}  // namespace

/// The next line that is neither empty nor a comment, without a comment at its end.
bool BdfCards::next_line() {
  while (at_ < text_.size()) {
    line_place_ = at_;
    const std::size_t end = std::min(text_.find('\n', at_), text_.size());
    line_ = text_.substr(at_, end - at_);
    at_ = std::min(end + 1, text_.size());
    line_ = line_.substr(0, line_.find('$'));
    while (!line_.empty() && trim(line_.substr(line_.size() - 1)).empty()) line_.remove_suffix(1);
    if (!trim(line_).empty()) return true;
  }
  return false;
}

void BdfCards::find_bulk(const std::function<void(std::string_view, std::size_t)>& take) {
  while (next_line()) {
    const std::string upper = to_upper(trim(line_));
    if (upper.starts_with("BEGIN")) return;
    if (upper.starts_with("GRID") || upper.starts_with("CTETRA")) break;
    if (take) take(upper, line_place_);
  }
  at_ = 0;
}

/// Fields of a line of a card, filled up to the width of the line.
void BdfCards::add_fields() {
  std::string_view line = line_;
  if (line.find(',') != std::string_view::npos) {
    split(line, split_);
    const std::size_t width = split_[0].find('*') != std::string_view::npos ? kLargeFieldsOfLine : kFieldsOfLine;
    // A line may be longer than that of a card in columns: all its fields are data, but for the name of a continuation.
    const std::size_t last = split_.size() == width + 2 && is_continuation(split_.back()) ? width : std::max(width, split_.size() - 1);
    for (std::size_t i = 1; i <= last; ++i) fields_.push_back(i < split_.size() ? split_[i] : std::string_view());
    return;
  }
  if (line.find('\t') != std::string_view::npos) {
    std::string& text = kept_.emplace_back();
    for (const char c : line) {
      text += c == '\t' ? ' ' : c;
      while (c == '\t' && text.size() % kNameWidth != 0) text += ' ';
    }
    line = text;
  }
  const std::size_t width = line.substr(0, kNameWidth).find('*') != std::string_view::npos ? 16 : 8;
  for (std::size_t at = kNameWidth; at < kDataEnd; at += width)
    fields_.push_back(at < line.size() ? trim(line.substr(at, std::min(width, kDataEnd - at))) : std::string_view());
}

bool BdfCards::next() {
  place_ = at_;
  if (!next_line()) return false;
  kept_.clear();
  fields_.clear();
  std::string_view name = line_.substr(0, std::min(line_.find(','), kNameWidth));
  name = trim(name.substr(0, name.find('*')));
  name_ = to_upper(name.substr(0, name.find_first_of(" \t")));
  place_ = line_place_;
  add_fields();
  for (;;) {
    const std::size_t before = at_;
    if (!next_line()) break;
    const char first = line_[0];
    const bool goes_on = first == '+' || first == '*' || first == ',' || first == '\t' || trim(line_.substr(0, kNameWidth)).empty();
    if (!goes_on) {
      at_ = before;
      break;
    }
    add_fields();
  }
  return true;
}

}  // namespace carillon::base
