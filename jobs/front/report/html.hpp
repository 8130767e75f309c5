// HTML that text cannot get into: whatever is not Html already is escaped on its way.
//   Html row = html("<td>{}</td><td>{:.2f}</td>", name, seconds);
#pragma once

#include <fmt/format.h>

#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

namespace carillon::report {

/// A piece of a page. Only html() and escape() make one that is not empty.
class Html {
 public:
  Html() = default;
  Html& operator+=(const Html& other) {
    text_ += other.text_;
    return *this;
  }
  const std::string& text() const { return text_; }
  bool empty() const { return text_.empty(); }

 private:
  explicit Html(std::string text) : text_(std::move(text)) {}
  friend Html escape(std::string_view, std::size_t);
  template <class... Args>
  friend Html html_of(fmt::string_view, const Args&...);
  std::string text_;
};

/// Text as a page or an attribute in quotation marks shows it. What is no UTF-8, control characters and those that turn the direction of
/// writing are shown as \x1b or \u202e; what is longer than `most` bytes is cut, with an ellipsis.
Html escape(std::string_view text, std::size_t max = 300);

template <class T>
using Shown = std::conditional_t<std::is_arithmetic_v<T>, T, std::string>;

template <class T>
Shown<T> show(const T& value) {
  if constexpr (std::is_arithmetic_v<T>) {
    return value;
  } else if constexpr (std::is_same_v<T, Html>) {
    return value.text();
  } else {
    return escape(value).text();
  }
}

template <class... Args>
Html html_of(fmt::string_view format, const Args&... args) {
  return Html(fmt::vformat(format, fmt::make_format_args(args...)));
}

/// `format` is markup of ours; numbers and Html among the arguments stay as they are, texts are escaped.
template <class... Args>
Html html(fmt::format_string<Shown<Args>...> format, const Args&... args) {
  return html_of(format, show(args)...);
}

struct Column {
  const char* head;
  bool is_number = false;
};

/// A table whose rows have as many cells as there are columns. Cells are Html, so that no text is unescaped.
class Table {
 public:
  explicit Table(std::vector<Column> columns) : columns_(std::move(columns)) {}
  /// As many cells as columns.
  void add(const std::vector<Html>& cells);
  bool empty() const { return rows_.empty(); }
  /// Nothing when there are no rows.
  Html finish() const;

 private:
  std::vector<Column> columns_;
  Html rows_;
};

/// Two columns, what and how much, with a remark in a third.
class Facts {
 public:
  void add(std::string_view what, const Html& value, std::string_view remark = {});
  bool empty() const { return rows_.empty(); }
  Html finish() const;

 private:
  Html rows_;
};

/// A section with its heading; `id` is for links to it.
Html make_section(const char* id, const char* heading, const Html& content);
/// The same for what is not known: a heading and why.
Html leave_out(const char* id, const char* heading, std::string_view why);

/// Texts set apart from the rest, as a list; nothing when there are none.
Html make_note(const std::vector<std::string>& texts);

/// The style sheet.
Html get_style();

}  // namespace carillon::report
