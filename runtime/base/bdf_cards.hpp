// Cards of a Nastran file (.bdf), with their continuations: fields of 8 or 16 columns or between commas.
#pragma once

#include <cstddef>
#include <deque>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

namespace carillon::base {

///   BdfCards cards(text);
///   cards.find_bulk();
///   while (cards.next()) use(cards.name(), cards.get(0));
///
/// Views are valid until the next card; the text must outlive them.
class BdfCards {
 public:
  explicit BdfCards(std::string_view text) : text_(text) {}

  /// Goes to the bulk data, after BEGIN or from the first line of a file without control sections. `take` gets each line of the control
  /// sections in upper case, with its place.
  void find_bulk(const std::function<void(std::string_view line, std::size_t place)>& take = {});

  /// The next card; false at the end of the text.
  bool next();

  const std::string& name() const { return name_; }  // in upper case, without an asterisk
  std::size_t place() const { return place_; }       // of its first line in the text
  std::size_t count() const { return fields_.size(); }
  /// A field after the name, trimmed; empty beyond the last one.
  std::string_view get(std::size_t i) const { return i < fields_.size() ? fields_[i] : std::string_view(); }

 private:
  bool next_line();
  void add_fields();

  std::string_view text_, line_;
  std::size_t at_ = 0, line_place_ = 0, place_ = 0;
  std::string name_;
  std::vector<std::string_view> fields_, split_;
  std::deque<std::string> kept_;  // lines of the card without tabs
};

}  // namespace carillon::base
