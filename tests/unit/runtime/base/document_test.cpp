#include "runtime/base/document.hpp"

#include <gtest/gtest.h>

#include <cstdlib>

namespace {

using carillon::InputError;
namespace base = carillon::base;

base::Object parse(const std::string& text) { return base::parse_document(text, "some/dir/file.json").root(); }

/// Message thrown by `act`; fails the test if none is thrown.
template <class Act>
std::string message_of(Act act) {
  try {
    act();
  } catch (const InputError& error) {
    return error.what();
  }
  ADD_FAILURE() << "no InputError was thrown";
  return "";
}

TEST(Document, reads_every_kind_of_value_and_comments) {
  auto object = parse("{ // a comment\n \"a\": 1.5, \"b\": \"x\", \"c\": [1, 2, 3], \"d\": true, \"e\": {\"f\": 7} }");
  EXPECT_EQ(object.number("a"), 1.5);
  EXPECT_EQ(object.string("b"), "x");
  EXPECT_EQ(object.numbers<3>("c")[2], 3.0);
  EXPECT_TRUE(object.boolean_or("d", false));
  auto inner = object.object("e");
  EXPECT_EQ(inner.integer("f", 0, 10), 7);
  inner.finish();
  object.finish();
}

TEST(Document, slashes_in_strings_are_not_comments) { EXPECT_EQ(parse(R"({"url": "a//b"})").string("url"), "a//b"); }

TEST(Document, relative_paths_start_at_the_folder_of_the_file) {
  const auto path = parse(R"({"mesh": "../m.msh"})").path("mesh");
  EXPECT_TRUE(path.is_absolute());
  EXPECT_TRUE(path.string().ends_with("some/m.msh")) << path;
}

TEST(Document, an_unknown_key_names_itself_its_line_and_the_nearest_known_key) {
  auto object = parse("{\n\"density\": 1,\n\"densty_kg_m3\": 2}");
  object.number("density");
  object.number_or("density_kg_m3", 1);
  const auto message = message_of([&] { object.finish(); });
  EXPECT_NE(message.find("file.json:3:"), std::string::npos) << message;
  EXPECT_NE(message.find("densty_kg_m3"), std::string::npos) << message;
  EXPECT_NE(message.find("did you mean \"density_kg_m3\""), std::string::npos) << message;
}

TEST(Document, suggestions_prefer_absent_keys) {
  auto object = parse("{\"alpha1_s\": 1,\n\"alpha2_s\": 2}");
  object.number_or("alpha1_s", 0);
  object.number_or("alpha2_per_s", 0);
  const auto message = message_of([&] { object.finish(); });
  EXPECT_NE(message.find("file.json:2:"), std::string::npos) << message;
  EXPECT_NE(message.find("did you mean \"alpha2_per_s\""), std::string::npos) << message;
}

TEST(Document, a_mistyped_required_key_is_reported_at_its_line) {
  const auto message = message_of([] { parse("{\n\n\"messh\": \"x\"}").string("mesh"); });
  EXPECT_NE(message.find("file.json:3:"), std::string::npos) << message;
  EXPECT_NE(message.find("messh"), std::string::npos) << message;
}

TEST(Document, suggestions_ignore_accidental_similarity) {
  const auto message = message_of([] { parse("{\n\"mass\": 1}").string("mesh"); });
  EXPECT_NE(message.find("\"mesh\" is missing"), std::string::npos) << message;
  EXPECT_EQ(message.find("mass"), std::string::npos) << message;
}

TEST(Document, nested_lines_and_names_are_exact) {
  auto list = parse("{\"bodies\": [\n{\"x\": 1},\n{\"x\": \"one\"}]}").objects("bodies");
  const auto message = message_of([&] { list[1].number("x"); });
  EXPECT_NE(message.find("file.json:3: \"bodies[1].x\""), std::string::npos) << message;
}

struct BadText {
  const char* name;
  const char* text;
  const char* words;
};
class BadDocument : public testing::TestWithParam<BadText> {};
TEST_P(BadDocument, is_rejected_with_a_message) {
  const auto message = message_of([&] {
    auto object = parse(GetParam().text);
    object.number("a", base::kPositive);
  });
  EXPECT_NE(message.find(GetParam().words), std::string::npos) << message;
  EXPECT_NE(message.find("file.json:"), std::string::npos) << message;
}
INSTANTIATE_TEST_SUITE_P(Table, BadDocument,
                         testing::Values(BadText{"empty", "", "not JSON"}, BadText{"array", "[1]", "JSON"},
                                         BadText{"comma", "{\"a\": 1,\n \"b\" 2}", "file.json:2"},
                                         BadText{"twice", "{\"a\": 1, \"a\": 2}", "there twice"},
                                         BadText{"tail", "{\"a\": 1} x", "not JSON"},
                                         BadText{"text", "{\"a\": \"1\"}", "must be a number, and is the text \"1\""},
                                         BadText{"negative", "{\"a\": -1}", "must be greater than 0, and is -1"},
                                         BadText{"missing", "{}", "\"a\" is missing here"}, BadText{"huge", "{\"a\": 1e999}", "file.json"},
                                         BadText{"nan", "{\"a\": NaN}", "not JSON"}, BadText{"list", "{\"a\": [1]}", "a list of 1"}),
                         [](const auto& info) { return info.param.name; });

TEST(Document, numbers_follow_the_grammar_of_json) {
  for (const char* good : {"0", "-0", "12", "-12.5", "0.5", "1e3", "1E+3", "2.5e-07", "100", "10.01", "1e007"}) {
    EXPECT_NO_THROW(parse(std::string("{\"a\": ") + good + "}").number("a")) << good;
    EXPECT_NO_THROW(parse(std::string("{\"a\":[") + good + "," + good + "]}").numbers<2>("a")) << good;
  }
  for (const char* bad :
       {"012", "00",   "-01", "01.5", "+1",    "+0.5",  "1.",    "-1.",   "1.e3", ".5",        "-.5",  "1e",  "1e+", "-",  "+",
        "--1", "0x10", "0b1", "0o7",  "1_000", "1.2.3", "1e5.5", "12abc", "3m",   "-Infinity", "-NaN", "1e-", "0e",  "- 1"}) {
    for (const std::string form : {"{\n\n\"a\": X}", "{\n\n\"b\": [1, X]}", "{\n\n\"a\":X}"}) {
      std::string text = form;
      text.replace(text.find('X'), 1, bad);
      const auto message = message_of([&] { parse(text).number("a"); });
      EXPECT_NE(message.find("file.json:3: "), std::string::npos) << bad << ": " << message;
    }
  }
  for (const char* bad : {"NaN", "Infinity", "inf", "nan", "True", "None"})
    EXPECT_NE(message_of([&] { parse(std::string("{\n\"a\": ") + bad + "}").number("a"); }).find("file.json:2"), std::string::npos) << bad;
  EXPECT_NE(message_of([] { parse("{\"a\": 0915}"); }).find("does not begin with a zero"), std::string::npos);
}

TEST(Document, numbers_are_the_nearest_doubles) {
  // Reference: C's strtod. Zeros in long forms, midpoints between doubles, and both ends of the range.
  for (const char* text : {"0",
                           "-0.0",
                           "0e-30",
                           "0e308",
                           "0.00000000000000000000000000000000000000000e-5",
                           "0.5",
                           "-12.5e-3",
                           "1E+22",
                           "9007199254740993",
                           "9007199254740993.0",
                           "9223372036854775807",
                           "9223372036854775808",
                           "18446744073709551616",
                           "1.7976931348623157e308",
                           "2.2250738585072014e-308",
                           "4.9e-324",
                           "1e-400",
                           "0.1234567890123456789012345678901",
                           "123456789012345678901234567890",
                           "-1e-5000"}) {
    const double number = parse(std::string("{\"a\": ") + text + "}").number("a");
    EXPECT_EQ(number, std::strtod(text, nullptr)) << text;
  }
  for (const char* text : {"1e309", "-1e309", "1.8e308", "1e99999"})
    EXPECT_NE(message_of([&] { parse(std::string("{\n\"a\": ") + text + "}").number("a"); }).find("file.json:2: this is not JSON"),
              std::string::npos)
        << text;
}

TEST(Document, numbers_in_strings_keys_and_comments_are_ignored) {
  auto object = parse("{ // 012 and +1\n \"01\": \"007\", /* .5 \" 1. */ \"a\": \"\\\"012\", \"b\": true, \"c\": 1 /*012*/, \"d\": [1,2]}");
  EXPECT_EQ(object.string("01"), "007");
  EXPECT_EQ(object.string("a"), "\"012");
  EXPECT_EQ(object.number("c"), 1.0);
  EXPECT_EQ(object.numbers<2>("d")[1], 2.0);
}

TEST(Document, finding_the_lines_of_all_values_reads_the_text_once) {
  std::string text = "{\"list\": [\n";
  constexpr int kEntries = 5000;
  for (int i = 0; i < kEntries; ++i) text += "{\"x\": 1}" + std::string(i + 1 < kEntries ? "," : "") + "\n";
  text += "]}";
  const auto document = base::parse_document(text, "some/dir/file.json");
  EXPECT_EQ(document.count_scanned_bytes(), 0u) << "no line was asked for yet";
  auto root = document.root();
  const auto list = root.objects("list");
  for (int i = 0; i < kEntries; ++i) {
    const std::string place = list[i].find_place("x");
    ASSERT_TRUE(place.ends_with("file.json:" + std::to_string(i + 2))) << place;
  }
  EXPECT_LE(document.count_scanned_bytes(), text.size());
  EXPECT_EQ(root.entries("list", kEntries)[4321].place.substr(root.entries("list", kEntries)[4321].place.rfind(':')), ":4323");
  EXPECT_LE(document.count_scanned_bytes(), text.size());
}

TEST(Document, an_excerpt_keeps_line_numbers) {
  auto whole = parse(
      "{\n\"name\": \"a\", // the body\n\"material\":\n  \"glass\", \"fixed\": true,\n\"shape\": {\"bowl\": {\n\"wall_m\": "
      "1e-3}},\n\"end\": [1, \"}\"]}");
  const base::Object::Excerpt excerpt = whole.make_excerpt({"shape", "end", "material", "none"});
  EXPECT_EQ(excerpt.first_line, 3);
  auto part = base::parse_document(excerpt.text, "some/dir/file.json", excerpt.first_line).root();
  EXPECT_EQ(part.keys(), (std::vector<std::string>{"material", "shape", "end"}));
  EXPECT_EQ(part.string("material"), "glass");
  EXPECT_EQ(part.object("shape").object("bowl").number("wall_m"), 1e-3);
  for (const char* key : {"material", "shape", "end"}) EXPECT_EQ(part.find_place(key), whole.find_place(key)) << key;
  auto bowl = part.object("shape").object("bowl");
  EXPECT_NE(message_of([&] { bowl.finish(); }).find("file.json:6:"), std::string::npos);
  whole.string("name");
  whole.boolean_or("fixed", false);
  whole.finish();  // all keys of the excerpt were requested
  EXPECT_EQ(parse("{}").make_excerpt({"a"}).text, "{}\n");
}

TEST(Document, deep_nesting_is_rejected) {
  const auto message = message_of([] { parse("{\"a\": " + std::string(1000000, '[')); });
  EXPECT_NE(message.find("brackets"), std::string::npos);
}

TEST(Document, messages_on_long_keys_are_short) {
  const std::string key = "\"" + std::string(1 << 20, 'k') + "\": 1";
  const auto message = message_of([&] { parse("{" + key + ", " + key + "}"); });
  EXPECT_LT(message.size(), 1000u);
}

TEST(FindNearest, counts_transpositions_and_rejects_distant_words) {
  EXPECT_EQ(base::find_nearest("mesch", {"mesh", "mass"}), "mesh");
  EXPECT_EQ(base::find_nearest("msah", {"mesh", "mash"}), "mash");
  EXPECT_EQ(base::find_nearest("zzzz", {"mesh", "mass"}), "");
}

TEST(FindNearest, matches_parts_of_names) {
  EXPECT_EQ(base::find_nearest("box", {"node_set", "box_m"}), "box_m");
  EXPECT_EQ(base::find_nearest("modes", {"mesh", "max_modes"}), "max_modes");
}

}  // namespace
