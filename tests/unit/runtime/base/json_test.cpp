#include "runtime/base/json.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <random>

#include "runtime/base/document.hpp"
#include "runtime/base/printable.hpp"

namespace {

using carillon::base::Json;
namespace base = carillon::base;

base::Object parse(const std::string& text) { return base::parse_document(text, "written.json").root(); }

TEST(Json, keeps_the_insertion_order) {
  Json value = Json::object();
  value.set("b", 1).set("a", true).set("c", "text").set("d", Json());
  value["list"].add(1).add(2.5).add("x");
  value.set("b", -3);
  EXPECT_EQ(value.line(), R"({"b": -3, "a": true, "c": "text", "d": null, "list": [1, 2.5, "x"]})");
  EXPECT_EQ(Json::object().line() + Json::array().line() + Json().line(), "{}[]null");
}

TEST(Json, breaks_only_long_lines) {
  Json value = Json::object();
  value.set("name", "bar").set("box_m", Json::array(std::vector{1.0, 2.0, 3.0}));
  for (int i = 0; i < 3; ++i) value["modes"].add(Json::object().set("freq_hz", 100 + i).set("is_rigid", false));
  EXPECT_EQ(value.text(50), R"({
  "name": "bar",
  "box_m": [1, 2, 3],
  "modes": [
    {"freq_hz": 100, "is_rigid": false},
    {"freq_hz": 101, "is_rigid": false},
    {"freq_hz": 102, "is_rigid": false}
  ]
}
)");
  EXPECT_EQ(value.text(50), Json(value).text(50));
}

TEST(Json, numbers_read_back_exactly) {
  std::mt19937_64 random(7);
  for (int i = 0; i < 10000; ++i) {
    const auto bits = random();
    double value = 0.0;
    static_assert(sizeof value == sizeof bits);
    std::memcpy(&value, &bits, sizeof value);
    if (!std::isfinite(value)) continue;
    auto read = parse(Json::object().set("x", value).line());
    ASSERT_EQ(read.number("x"), value);
    auto rounded = parse(Json::object().set("x", base::significant(value, 6)).line());
    ASSERT_NEAR(rounded.number("x") / value, 1.0, 5.1e-6) << value;
  }
  EXPECT_EQ(Json(std::numeric_limits<std::int64_t>::min()).line(), "-9223372036854775808");
  EXPECT_EQ(Json(std::numeric_limits<std::uint64_t>::max()).line(), "18446744073709551615");
}

TEST(Json, numbers_have_the_requested_digits) {
  EXPECT_EQ(base::significant(1234.5678, 6).line(), "1234.57");
  EXPECT_EQ(base::significant(2.0, 6).line(), "2");
  EXPECT_EQ(base::decimals(2.0 / 3.0, 4).line(), "0.6667");
  EXPECT_EQ(Json(0.1).line(), "0.1");
}

TEST(Json, rejects_infinity_and_nan) {
  const double nan = std::nan(""), infinity = std::numeric_limits<double>::infinity();
  for (const double value : {nan, infinity, -infinity}) {
    EXPECT_THROW(Json{value}, std::invalid_argument);
    EXPECT_THROW(base::significant(value, 6), std::invalid_argument);
    EXPECT_THROW(base::decimals(value, 6), std::invalid_argument);
    EXPECT_EQ(base::finite_or_null(value, base::significant, 6).line(), "null");
  }
  EXPECT_EQ(base::finite_or_null(1.25, base::decimals, 1).line(), "1.2");
}

TEST(Json, strings_read_back_exactly) {
  std::string every;
  for (int byte = 1; byte < 0x80; ++byte) every += static_cast<char>(byte);
  for (const std::string& text : {every, std::string("\"\\\n\t"), std::string("Glöckchen \u202E\u009b \U000E0041 \U0001F514")}) {
    const std::string line = Json::object().set("x", text).line();
    auto read = parse(line);
    EXPECT_EQ(read.string_or("x", ""), text);
    EXPECT_EQ(base::printable(line), line);  // free of control characters
  }
  EXPECT_EQ(base::quote("\x1b\u202E"), "\"\\u001b\\u202e\"");
}

TEST(Json, keys_are_escaped) { EXPECT_EQ(Json::object().set("a\"b", 1).line(), R"({"a\"b": 1})"); }

TEST(Json, an_empty_optional_is_null) {
  Json value = Json::object();
  value.set("some", std::optional<double>(0.5)).set("none", std::optional<double>());
  EXPECT_EQ(value.line(), R"({"some": 0.5, "none": null})");
}

TEST(Json, members_need_objects_and_elements_arrays) {
  EXPECT_THROW(Json(1).set("a", 1), std::logic_error);
  EXPECT_THROW(Json::array()["a"], std::logic_error);
  EXPECT_THROW(Json::object().add(1), std::logic_error);
}

TEST(Json, parses_valid_json_only) {
  const Json value =
      Json::parse("{\"b\": [1, -2.5e3, true, null], // comment\n \"a\": \"\\u00e4\\n\", \"b\": {\"c\": 18446744073709551615}}").value();
  EXPECT_EQ(value.line(), R"({"a": "ä\u000a", "b": {"c": 18446744073709551615}})");  // the last of equal keys
  EXPECT_EQ(value["a"].as_string(), "ä\n");
  EXPECT_EQ(value["b"]["c"].as_double(), 18446744073709551616.0);
  EXPECT_TRUE(value["none"]["deeper"].is_null());
  EXPECT_EQ(value.keys(), (std::vector<std::string>{"a", "b"}));
  EXPECT_THROW((void)value["a"].as_double(), std::logic_error);
  EXPECT_THROW((void)value["b"].as_string(), std::logic_error);
  for (const char* text : {"", "[1,]", "[1] 2", "{\"a\" 1}", "[01]", "[1e999]", "'a'", "NaN"}) EXPECT_FALSE(Json::parse(text)) << text;
  EXPECT_FALSE(Json::parse(std::string("[1\0]", 4)));
}

TEST(Json, nesting_is_limited) {
  const auto nest = [](std::size_t depth) { return std::string(depth, '[') + std::string(depth, ']'); };
  EXPECT_EQ(Json::parse(nest(100)).value().line(), nest(100));
  EXPECT_FALSE(Json::parse(nest(101)));
  EXPECT_FALSE(Json::parse(std::string(1'000'000, '[')));
}

TEST(Json, sorted_text_has_the_layout_of_records) {
  Json value = Json::object();
  value.set("b", Json::array(std::vector{0.1, 2.0}))
      .set("a", 1)
      .set("c", "ä\x01\"")
      .set("d", Json::object())
      .set("e", base::decimals(0.1, 1));
  value["f"]["g"].add(Json::array(std::vector{1, 2}));
  EXPECT_EQ(value.sorted_text(),
            R"({"a":1,"b":[0.10000000000000001,2.0],"c":"\u00e4\u0001\"","d":{},"e":0.10000000000000001,"f":{"g":[[1,2]]}})");
  EXPECT_EQ(value.sorted_text({.indentation = "  ", .is_ascii = false}), R"({
  "a" : 1,
  "b" : [ 0.10000000000000001, 2.0 ],
  "c" : "ä\u0001\"",
  "d" : {},
  "e" : 0.10000000000000001,
  "f" : 
  {
    "g" : 
    [
      [ 1, 2 ]
    ]
  }
})");
  EXPECT_EQ(Json::array(std::vector{1, 2}).sorted_text({.indentation = " ", .breaks_arrays = true}), "[\n 1,\n 2\n]");
}

TEST(Json, members_are_removed) {
  Json value = Json::object().set("a", 1).set("b", 2);
  value.erase("a");
  value.erase("c");
  EXPECT_EQ(value.line(), R"({"b": 2})");
  EXPECT_FALSE(value.has("a"));
}

}  // namespace
