#include "runtime/base/keys.hpp"

#include <gtest/gtest.h>

#include "runtime/base/error.hpp"
#include "tests/support/catch_message.hpp"

namespace carillon::base {
namespace {

enum class Colour { red, green };
const std::vector<std::string> kColours{"red", "green"};

struct Thing {
  double height_m = 0.5, ratio = 0.2, mass_kg = 0.0;
  std::optional<double> width_m = {};
  int count = 3;
  bool fixed = false;
  Colour colour = Colour::green;
  std::string side = {};
  Vec3 place_m{0, 0, 1};
};

const Keys<Thing> kThing{{"mass_kg", &Thing::mass_kg, Limits{1, 9}, "mass", required},
                         {"height_m", &Thing::height_m, within(2), "height"},
                         {"ratio", &Thing::ratio, Limits{-1, 0.5, true}, "Poisson's ratio"},
                         {"width_m", &Thing::width_m, kAboveZero, "width"},
                         {"count", &Thing::count, Limits{2, 4}, "number"},
                         {"fixed", &Thing::fixed, "does not move"},
                         {"colour", &Thing::colour, kColours, "colour"},
                         {"side", &Thing::side, {"in", "out"}, "side"},
                         {"place_m", &Thing::place_m, within(5), "place"},
                         {"other", "none", "read elsewhere"}};

Thing read(const std::string& text) {
  Object object = parse_document(text, "/thing.json").root();
  Thing thing;
  kThing.read(object, thing);
  object.finish();
  return thing;
}

std::string refuse(const std::string& text) {
  return tests::catch_message<InputError>([&] { read(text); });
}

TEST(Keys, ReadMembersOfAllTypes) {
  const Thing thing = read(R"({"mass_kg": 2, "height_m": -2, "ratio": 0.4, "width_m": 3, "count": 4, "fixed": true, "colour": "red",
                               "side": "out", "place_m": [1, 2, 3]})");
  EXPECT_EQ(thing.mass_kg, 2.0);
  EXPECT_EQ(thing.height_m, -2.0);
  EXPECT_EQ(thing.ratio, 0.4);
  EXPECT_EQ(thing.width_m, 3.0);
  EXPECT_EQ(thing.count, 4);
  EXPECT_TRUE(thing.fixed);
  EXPECT_EQ(thing.colour, Colour::red);
  EXPECT_EQ(thing.side, "out");
  EXPECT_EQ(thing.place_m, (Vec3{1, 2, 3}));
  const Thing plain = read(R"({"mass_kg": 2})");
  EXPECT_EQ(plain.height_m, 0.5);
  EXPECT_EQ(plain.place_m, (Vec3{0, 0, 1}));
}

TEST(Keys, ErrorsNamePlaceAndRange) {
  for (const auto& [keys, words] : std::vector<std::pair<std::string, std::string>>{
           {R"("mass_kg": 10)", "/thing.json:1: \"mass_kg\": 10 is out of range; give a number from 1 to 9 kg"},
           {R"("masskg": 2)", "did you mean \"mass_kg\"?"},
           {R"("mass_kg": 1, "ratio": 0.5)", "between -1 and 0.5"},
           {R"("mass_kg": 1, "width_m": 0)", "greater than 0"},
           {R"("mass_kg": 1, "count": 5)", "from 2 to 4"},
           {R"("mass_kg": 1, "colour": "gren")", "did you mean \"green\"?"},
           {R"("mass_kg": 1, "place_m": [0, 0, 6])", "6 is out of range"},
           {R"("mass_kg": 1, "other": 1)", "unknown key"}})
    EXPECT_NE(refuse("{" + keys + "}").find(words), std::string::npos) << refuse("{" + keys + "}");
}

TEST(Keys, WriteWhatTheyRead) {
  const std::string text =
      R"({"mass_kg": 2, "height_m": 0.5, "ratio": 0.2, "width_m": 1, "count": 3, "fixed": false, "colour": "green", "place_m": [0, 0, 1]})";
  EXPECT_EQ(kThing.write(read(text)).line(), text);
}

TEST(Keys, DescribeDefaultsAndRanges) {
  KeyTable table{"thing", {}};
  kThing.describe(table, "a.");
  const std::string text = write_key_tables({table});
  for (const char* row :
       {"# thing\n", "| `a.mass_kg` | required | mass; 1 to 9 kg |", "| `a.height_m` | `0.5` | height; -2 to 2 m |",
        "| `a.ratio` | `0.2` | Poisson's ratio; -1 to 0.5, both excluded |", "| `a.width_m` | none | width; above 0 m |",
        "| `a.fixed` | `false` | does not move |", "| `a.colour` | `\"green\"` | colour: `\"red\"`, `\"green\"` |",
        "| `a.side` | none | side: `\"in\"`, `\"out\"` |", "| `a.place_m` | `[0, 0, 1]` |", "| `a.other` | none | read elsewhere |"})
    EXPECT_NE(text.find(row), std::string::npos) << row << "\n" << text;
}

}  // namespace
}  // namespace carillon::base
