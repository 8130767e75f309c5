// Banks with multipoles: files, selected modes, played banks, edits and reports.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "runtime/bank/air.hpp"
#include "runtime/bank/corrected.hpp"
#include "runtime/bank/edits.hpp"
#include "runtime/bank/layout.hpp"
#include "runtime/bank/pack.hpp"
#include "runtime/bank/reduce.hpp"
#include "runtime/bank/report.hpp"
#include "runtime/bank/select.hpp"
#include "runtime/bank/write.hpp"
#include "tests/support/folder.hpp"
#include "tests/unit/runtime/bank/bank_arrays.hpp"
#include "tests/unit/runtime/bank/example_bank.hpp"
#include "tests/unit/runtime/bank/seal_again.hpp"

namespace carillon::bank {
namespace {

constexpr std::size_t kModes = 9;

// ---- files ----

void expect_same(const Multipoles& a, const Multipoles& b) {
  EXPECT_EQ(a.centre_m, b.centre_m);
  EXPECT_EQ(a.radius_m, b.radius_m);
  EXPECT_EQ(a.nearest_m, b.nearest_m);
  EXPECT_EQ(a.air_density_kg_m3, b.air_density_kg_m3);
  EXPECT_EQ(a.sound_speed_ms, b.sound_speed_ms);
  EXPECT_EQ(a.freq_hz, b.freq_hz);
  EXPECT_EQ(a.order, b.order);
  EXPECT_EQ(a.scale, b.scale);
  EXPECT_EQ(a.coefficient, b.coefficient);
  EXPECT_EQ(a.decay_per_s, b.decay_per_s);
  EXPECT_EQ(a.added_mass, b.added_mass);
  EXPECT_EQ(a.error_db, b.error_db);
  EXPECT_EQ(a.method, b.method);
  EXPECT_EQ(a.is_in_decay, b.is_in_decay);
}

TEST(MultipoleFile, ReadsBackExactlyAndRaisesTheVersion) {
  const tests::Folder folder;
  const std::filesystem::path file = folder.path() / "bank.hdf";
  Bank everything = example::make_radiating_bank(2, kModes);
  everything.supports = example::make_supported_bank(2, kModes).supports;
  everything.regions = R"([{"region": "body"}, {"region": "neck"}])";
  keep_lowest(everything, 5);
  ASSERT_GT(everything.proof->complete_below_hz, 0.0);
  Bank plain = example::make_bank(2, 3);
  example::add_multipoles(plain);
  plain.multipoles.method.clear();
  for (const Bank& bank : {example::make_radiating_bank(2, kModes), everything, plain}) {
    write_bank(bank, file);
    EXPECT_EQ(read_version(file), (std::array{1, 5}));
    const Bank read = read_bank(file);
    expect_same(read.multipoles, bank.multipoles);
    EXPECT_EQ(make_bank_bytes(read), make_bank_bytes(bank));
  }
}

TEST(MultipoleFile, PackingKeepsThemExactly) {
  const tests::Folder folder;
  const std::filesystem::path file = folder.path() / "packed.hdf";
  const Bank bank = example::make_radiating_bank(2, kModes);
  write_packed_bank(calc_packed(bank, -40.0), file);
  EXPECT_EQ(read_version(file), (std::array{2, 1}));
  const Bank packed = read_bank(file);
  expect_same(packed.multipoles, bank.multipoles);
  expect_same(parse_bank(bytes_of(make_bank_bytes(packed))).multipoles, bank.multipoles);
}

TEST(MultipoleFile, ABankWithoutThemHasAnOlderVersion) {
  const tests::Folder folder;
  const std::filesystem::path file = folder.path() / "bank.hdf";
  write_bank(example::make_corrected_bank(2, kModes), file);
  EXPECT_EQ(read_version(file), (std::array{1, 4}));
  EXPECT_TRUE(read_bank(file).multipoles.is_empty());
}

Arrays make_arrays() { return Arrays(example::make_radiating_bank(2, kModes)); }

TEST(MultipoleFile, HoldsAllOfItsArraysOrNone) {
  std::size_t count = 0;
  for (std::size_t i = 0; i < make_arrays().list.size(); ++i) {
    Arrays arrays = make_arrays();
    const std::string name = arrays.list[i].field.name;
    if (!name.starts_with("radiation/")) continue;
    ++count;
    arrays.list.erase(arrays.list.begin() + static_cast<std::ptrdiff_t>(i));
    EXPECT_NE(arrays.find_error().find("the array " + name + " is missing"), std::string::npos) << arrays.find_error();
  }
  EXPECT_EQ(count, 13u);
  Arrays none = make_arrays();
  std::erase_if(none.list, [](const FieldBytes& array) { return array.field.name.starts_with("radiation/"); });
  EXPECT_EQ(none.find_error(), "");
}

TEST(MultipoleFile, WrongSizesAndTypesAreRejected) {
  ASSERT_EQ(make_arrays().find_error(), "");
  for (const char* name : {"freq_hz", "scale", "decay", "added_mass", "error_db", "order"}) {
    Arrays fewer = make_arrays();
    FieldBytes& array = fewer.find(std::string("radiation/") + name);
    array.field.shape = {kModes - 1};
    array.bytes = array.bytes.first(array.bytes.size() / kModes * (kModes - 1));
    EXPECT_NE(fewer.find_error().find("arrays disagree"), std::string::npos) << name << ": " << fewer.find_error();
    Arrays none = make_arrays();
    none.find(std::string("radiation/") + name).field.shape = {0};
    none.find(std::string("radiation/") + name).bytes = {};
    EXPECT_NE(none.find_error().find("arrays disagree"), std::string::npos) << name << ": " << none.find_error();
  }
  const auto expect_refused = [](const char* name, const char* dtype, std::vector<std::uint64_t> shape) {
    Arrays arrays = make_arrays();
    FieldBytes& array = arrays.find(name);
    array.field.dtype = dtype;
    array.field.shape = std::move(shape);
    EXPECT_NE(arrays.find_error(), "") << name;
  };
  const std::uint64_t rows = make_arrays().bank.multipoles.coefficient.size() / 2;
  expect_refused("radiation/coefficient", "<i2", {2 * rows});
  expect_refused("radiation/coefficient", "<i2", {rows, 2, 1});
  expect_refused("radiation/coefficient", "<i2", {2, rows});
  expect_refused("radiation/coefficient", "|i1", {2 * rows, 2});
  expect_refused("radiation/coefficient", "<i2", {(std::uint64_t{1} << 62) + rows, 2});
  expect_refused("radiation/coefficient", "<i2", {});
  expect_refused("radiation/order", "<i2", {2 * kModes});
  expect_refused("radiation/radius_m", "<f8", {1});
  expect_refused("radiation/centre_m", "<f8", {1, 3});
  expect_refused("radiation/method", "|u1", {19});
}

TEST(MultipoleFile, ABankWithoutModesDropsTheEmptyGroup) {
  const Bank bank = example::make_bank(2, 0);
  const FileForm form = make_file_form(bank);
  std::vector<FieldBytes> arrays;
  for (const Field& field : list_fields(bank, form))
    arrays.push_back({field, {static_cast<const std::byte*>(field.data), calc_bytes(field)}});
  const double number = 7.0;
  const std::vector<std::int16_t> steps(6, 5);
  for (const char* name : {"freq_hz", "scale", "decay", "added_mass", "error_db"})
    arrays.push_back({{std::string("radiation/") + name, "<f8", {0}, "", "", nullptr}, {}});
  arrays.push_back({{"radiation/order", "<i4", {0}, "", "", nullptr}, {}});
  arrays.push_back({{"radiation/coefficient", "<i2", {3, 2}, "", "", nullptr}, std::as_bytes(std::span(steps))});
  arrays.push_back({{"radiation/method", "|S8", {}, "", "", nullptr}, std::as_bytes(std::span(&number, 1))});
  const Bank read = assemble_bank(arrays, "arrays");
  EXPECT_TRUE(read.multipoles.coefficient.empty());
  EXPECT_EQ(make_bank_bytes(read), make_bank_bytes(bank));
}

TEST(MultipoleFile, DamagedArraysAreRejectedOrValid) {
  for (const bool is_packed : {false, true}) {
    const Bank bank = example::make_radiating_bank(1, kModes);
    const std::string bytes = is_packed ? make_packed_bytes(calc_packed(bank, -40.0)) : make_bank_bytes(bank);
    // Positions of the group's arrays in the seal.
    std::vector<std::size_t> places;
    for (std::size_t at = bytes.find("field radiation/"); at != std::string::npos; at = bytes.find("field radiation/", at + 1)) {
      const std::size_t type = bytes.find(' ', at + 6) + 1, offset = bytes.find(' ', type) + 1;
      for (std::size_t i = 0; i < 24; ++i) places.push_back(std::stoul(bytes.substr(offset, 20)) + i);
    }
    ASSERT_EQ(places.size(), 13u * 24);
    std::mt19937 random(5);
    int sane = 0, refused = 0;
    for (int round = 0; round < 600; ++round) {
      std::string changed = bytes;
      char& byte = changed[places[random() % places.size()]];
      byte = static_cast<char>(byte ^ (1 << random() % 8));
      try {
        const Bank read = parse_bank(bytes_of(seal_again(changed)));
        EXPECT_EQ(find_faults(read), std::vector<std::string>{});
        EXPECT_FALSE(read.multipoles.is_in_decay);
        (void)calc_corrected(read);
        ++sane;
      } catch (const InputError&) {
        ++refused;
      }
    }
    EXPECT_GT(sane, 50);
    EXPECT_GT(refused, 200);
  }
}

// ---- fewer modes, other orders ----

/// Coefficients of a mode [Pa s m^-1 kg^-1/2].
std::vector<double> list_coefficients(const Multipoles& air, std::size_t mode) {
  std::size_t first = 0;
  for (std::size_t m = 0; m < mode; ++m) first += static_cast<std::size_t>(2 * (air.order[m] + 1) * (air.order[m] + 1));
  std::vector<double> list;
  for (std::size_t i = 0; i < static_cast<std::size_t>(2 * (air.order[mode] + 1) * (air.order[mode] + 1)); ++i)
    list.push_back(air.scale[mode] * air.coefficient.at(first + i));
  return list;
}

void expect_mode(const Multipoles& a, std::size_t mode, const Multipoles& b, std::size_t of) {
  EXPECT_EQ(a.freq_hz.at(mode), b.freq_hz[of]);
  EXPECT_EQ(a.order.at(mode), b.order[of]);
  EXPECT_EQ(list_coefficients(a, mode), list_coefficients(b, of));
  EXPECT_EQ(a.decay_per_s.at(mode), b.decay_per_s[of]);
  EXPECT_EQ(a.added_mass.at(mode), b.added_mass[of]);
  EXPECT_EQ(a.error_db.at(mode), b.error_db[of]);
}

TEST(MultipoleSelection, ModesKeepTheirMultipoles) {
  const Bank bank = example::make_radiating_bank(2, kModes);
  const std::vector<std::size_t> chosen{8, 2, 3, 0};
  Bank some = bank;
  select_modes(some, chosen);
  ASSERT_EQ(some.multipoles.order.size(), 4u);
  for (std::size_t m = 0; m < 4; ++m) expect_mode(some.multipoles, m, bank.multipoles, chosen[m]);
  EXPECT_EQ(some.multipoles.method, bank.multipoles.method);
  Bank none = bank;
  select_modes(none, {});
  EXPECT_TRUE(none.multipoles.is_empty());
  EXPECT_EQ(none.multipoles.radius_m, 0.0);
}

TEST(MultipoleSelection, ReducedBanksAreValid) {
  const Bank bank = example::make_radiating_bank(2, kModes);
  for (const Keep keep : {Keep::kLoudest, Keep::kLowest}) {
    const Bank reduced = calc_reduced(bank, {.modes = 4, .keep = keep, .shape_bits = 8});
    EXPECT_EQ(find_faults(reduced), std::vector<std::string>{});
    ASSERT_EQ(reduced.multipoles.order.size(), 4u);
    for (std::size_t m = 0; m < 4; ++m) {
      std::size_t of = 0;
      while (bank.eigenvalue_rad2_s2[of] != reduced.eigenvalue_rad2_s2[m]) ++of;
      expect_mode(reduced.multipoles, m, bank.multipoles, of);
    }
  }
}

// ---- playing ----

TEST(PlayedInAir, HasFrequenciesInAirWithTheDecaysOfRadiation) {
  const Bank bank = example::make_radiating_bank(2, kModes), played = calc_corrected(bank);
  EXPECT_EQ(find_faults(played), std::vector<std::string>{});
  EXPECT_FALSE(played.proof.has_value());
  std::vector<double> wanted = bank.multipoles.freq_hz;
  std::sort(wanted.begin(), wanted.end());
  const std::vector<std::size_t> order = sort_played_modes(bank);
  EXPECT_NE(order, sort_modes(bank)) << "the example has modes that change places in air";
  for (std::size_t m = 0; m < kModes; ++m) {
    const std::size_t of = order[m];
    EXPECT_NEAR(played.freq_hz(m) / wanted[m], 1.0, 1e-14);
    EXPECT_NEAR(played.decay_per_s[m], bank.corrected.decay_per_s[of] + bank.multipoles.decay_per_s[of], 1e-12);
    expect_mode(played.multipoles, m, bank.multipoles, of);
    // Power of the gain over a sphere of 1 m, over twice the energy 1/2.
    const double power = 4.0 * std::numbers::pi * std::pow(played.radiation_gain[m], 2) / (2.0 * 1.21 * 343.0);
    EXPECT_NEAR(power / bank.multipoles.decay_per_s[of], 1.0, 1e-12);
    EXPECT_EQ(played.discretisation_error_cents[m], bank.corrected.error_cents[of]);
    for (const std::size_t vertex : {0U, 7U, 25U}) EXPECT_EQ(played.shape_at(vertex, m), bank.shape_at(vertex, of));
  }
}

TEST(PlayedInAir, RadiationIsAddedOnce) {
  for (const bool is_corrected : {true, false}) {
    Bank bank = example::make_radiating_bank(2, kModes);
    if (!is_corrected) bank.corrected = {};
    for (const auto& [first, second] :
         {std::pair(Frequencies::kCorrected, Frequencies::kCorrected), std::pair(Frequencies::kMesh, Frequencies::kMesh),
          std::pair(Frequencies::kMesh, Frequencies::kCorrected)}) {
      const Bank once = choose_frequencies(bank, second), twice = choose_frequencies(choose_frequencies(bank, first), second);
      EXPECT_EQ(once.decay_per_s, twice.decay_per_s);
      EXPECT_EQ(once.eigenvalue_rad2_s2, twice.eigenvalue_rad2_s2);
      EXPECT_EQ(once.radiation_gain, twice.radiation_gain);
      expect_same(once.multipoles, twice.multipoles);
    }
    const Bank played = calc_corrected(bank), mesh = choose_frequencies(played, Frequencies::kMesh);
    EXPECT_EQ(mesh.decay_per_s, played.decay_per_s);
  }
}

TEST(PlayedInAir, WithoutCorrectionDecaysAreThoseOfTheMesh) {
  Bank bank = example::make_radiating_bank(2, kModes);
  bank.corrected = {};
  bank.multipoles = {};
  example::add_multipoles(bank);
  ASSERT_EQ(find_faults(bank), std::vector<std::string>{});
  const Bank played = calc_corrected(bank);
  EXPECT_EQ(find_faults(played), std::vector<std::string>{});
  EXPECT_TRUE(std::is_sorted(played.eigenvalue_rad2_s2.begin(), played.eigenvalue_rad2_s2.end()));
  const std::vector<std::size_t> order = sort_played_modes(bank);
  for (std::size_t m = 0; m < kModes; ++m) {
    EXPECT_NEAR(played.freq_hz(m) / bank.multipoles.freq_hz[order[m]], 1.0, 1e-14);
    EXPECT_NEAR(played.decay_per_s[m], bank.decay_per_s[order[m]] + bank.multipoles.decay_per_s[order[m]], 1e-12);
  }
}

TEST(PlayedInAir, MeshFrequenciesAreKeptOnRequest) {
  const Bank bank = example::make_radiating_bank(2, kModes), played = choose_frequencies(bank, Frequencies::kMesh);
  EXPECT_EQ(find_faults(played), std::vector<std::string>{});
  EXPECT_EQ(played.eigenvalue_rad2_s2, bank.eigenvalue_rad2_s2);
  EXPECT_TRUE(played.proof.has_value());
  for (std::size_t m = 0; m < kModes; ++m) {
    EXPECT_DOUBLE_EQ(played.decay_per_s[m], bank.decay_per_s[m] + bank.multipoles.decay_per_s[m]);
    EXPECT_NEAR(calc_radiation_decay(played.radiation_gain[m]) / bank.multipoles.decay_per_s[m], 1.0, 1e-14);
  }
}

// Supports see the elastic body's shape; the surrounding air changes the frequency only.
TEST(PlayedInAir, ReactionsAreThoseOfTheCorrectedBody) {
  Bank bank = example::make_radiating_bank(2, kModes);
  bank.supports = example::make_supported_bank(2, kModes).supports;
  const Bank played = calc_corrected(bank);
  const std::vector<std::size_t> order = sort_played_modes(bank);
  for (std::size_t m = 0; m < kModes; ++m)
    for (std::size_t i = 0; i < 12; ++i) {
      const double wanted =
          bank.supports.reaction[order[m] * 12 + i] * std::pow(bank.corrected.freq_hz[order[m]] / bank.freq_hz(order[m]), 2);
      EXPECT_NEAR(played.supports.reaction[m * 12 + i] / wanted, 1.0, 1e-12);
    }
}

TEST(PlayedInAir, IsNotWritten) {
  const Bank played = calc_corrected(example::make_radiating_bank(2, kModes));
  EXPECT_THROW(make_bank_bytes(played), InputError);
  const tests::Folder folder;
  EXPECT_THROW(write_bank(played, folder.path() / "played.hdf"), InputError);
}

TEST(PlayedInAir, ADecayBelowRadiationIsAFault) {
  Bank played = calc_corrected(example::make_radiating_bank(2, kModes));
  played.decay_per_s[4] = 0.99 * played.multipoles.decay_per_s[4];
  const std::vector<std::string> faults = find_faults(played);
  ASSERT_EQ(faults.size(), 1u);
  EXPECT_NE(faults[0].find("radiation alone gives"), std::string::npos) << faults[0];
}

// ---- edits ----

TEST(MultipoleEdits, SizeMatchesARecomputedSphere) {
  const Bank bank = example::make_radiating_bank(2, kModes);
  for (const double g : {0.3, 2.0, 17.0}) {
    const Bank edited = calc_edited(bank, {.size_scale = g});
    EXPECT_EQ(find_faults(edited), std::vector<std::string>{});
    EXPECT_EQ(describe_dropped(bank, {.size_scale = g}), "");
    Multipoles again = example::make_air(edited);
    for (std::size_t m = 0; m < kModes; ++m) {
      const double i = static_cast<double>(m), phi = std::pow(g, -1.5);
      example::add_sphere_mode(again, bank.multipoles.freq_hz[m] / g,
                               {phi * (0.2 + 0.1 * i), {phi * 0.3 * std::sin(i), phi * 0.5 * std::cos(i), phi * (0.4 - 0.05 * i)}},
                               bank.multipoles.order[m]);
      EXPECT_NEAR(edited.multipoles.freq_hz[m] / again.freq_hz[m], 1.0, 1e-13);
      EXPECT_NEAR(edited.multipoles.scale[m] / again.scale[m], 1.0, 1e-12);
      EXPECT_NEAR(edited.multipoles.decay_per_s[m] / again.decay_per_s[m], 1.0, 1e-12);
      EXPECT_NEAR(edited.multipoles.added_mass[m] / again.added_mass[m], 1.0, 1e-12);
      EXPECT_NEAR(edited.multipoles.freq_hz[m] / edited.corrected.freq_hz[m], bank.multipoles.freq_hz[m] / bank.corrected.freq_hz[m],
                  1e-12);
    }
    ASSERT_EQ(edited.multipoles.coefficient.size(), again.coefficient.size());
    for (std::size_t i = 0; i < again.coefficient.size(); ++i) EXPECT_NEAR(edited.multipoles.coefficient[i], again.coefficient[i], 1.0);
    EXPECT_NEAR(edited.multipoles.radius_m / again.radius_m, 1.0, 1e-12);
    EXPECT_NEAR(edited.multipoles.nearest_m / again.nearest_m, 1.0, 1e-12);
    for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(edited.multipoles.centre_m[c] / again.centre_m[c], 1.0, 1e-12);
  }
}

TEST(MultipoleEdits, DampingKeepsAndMaterialDropsThem) {
  const Bank bank = example::make_radiating_bank(2, kModes);
  const Edits damped{.alphas = {{2e-8, 7.0}}};
  EXPECT_EQ(describe_dropped(bank, damped), "");
  expect_same(calc_edited(bank, damped).multipoles, bank.multipoles);
  EXPECT_EQ(calc_edited(bank, damped).provenance.find("dropped"), std::string::npos);
  for (const Edits& edits : {Edits{.density_scale = 2.0}, Edits{.stiffness_scale = 0.5}, Edits{.density_scale = 2.0, .size_scale = 3.0}}) {
    const Bank edited = calc_edited(bank, edits);
    EXPECT_TRUE(edited.multipoles.is_empty());
    EXPECT_EQ(edited.multipoles.radius_m, 0.0);
    EXPECT_EQ(find_faults(edited), std::vector<std::string>{});
    EXPECT_NE(edited.provenance.find(R"("radiation": "dropped")"), std::string::npos) << edited.provenance;
    EXPECT_EQ(describe_dropped(bank, edits).find("radiation: dropped, "), 0u);
    EXPECT_EQ(describe_dropped(example::make_bank(2, 5), edits), "");
  }
}

TEST(MultipoleEdits, APlayedBankMayBeScaled) {
  Bank bank = example::make_radiating_bank(2, kModes);
  const Bank played = choose_frequencies(bank, Frequencies::kMesh), edited = calc_edited(played, {.size_scale = 2.0});
  const Bank wanted = choose_frequencies(calc_edited(bank, {.size_scale = 2.0}), Frequencies::kMesh);
  EXPECT_TRUE(edited.multipoles.is_in_decay);
  for (std::size_t m = 0; m < kModes; ++m) {
    EXPECT_NEAR(edited.decay_per_s[m] / wanted.decay_per_s[m], 1.0, 1e-12);
    EXPECT_NEAR(edited.radiation_gain[m] / wanted.radiation_gain[m], 1.0, 1e-12);
  }
  const Bank lighter = calc_edited(played, {.density_scale = 0.5});
  EXPECT_FALSE(lighter.multipoles.is_in_decay);
  EXPECT_EQ(lighter.decay_per_s, calc_edited(bank, {.density_scale = 0.5}).decay_per_s);
}

// ---- info ----

TEST(MultipoleInfo, ShowsOrdersErrorDampingAndAddedMass) {
  const tests::Folder folder;
  const std::filesystem::path file = folder.path() / "bank.hdf";
  const Bank bank = example::make_radiating_bank(2, kModes);
  write_bank(bank, file);
  const std::string text = format_info(bank, list_heard(bank, {}), file, 20, false);
  std::size_t strong = 0;
  double mass = 0.0;
  for (std::size_t m = 0; m < kModes; ++m) {
    strong += bank.multipoles.decay_per_s[m] / (bank.multipoles.decay_per_s[m] + bank.corrected.decay_per_s[m]) > 0.5 ? 1 : 0;
    mass = std::max(mass, bank.multipoles.added_mass[m]);
  }
  ASSERT_GT(strong, 0u);
  ASSERT_LT(strong, kModes);
  EXPECT_NE(text.find("radiation made up: a sphere"), std::string::npos) << text;
  EXPECT_NE(text.find("order 1 to 4"), std::string::npos) << text;
  EXPECT_NE(text.find("error at most -45.0 dB from 0.22"), std::string::npos) << text;
  EXPECT_NE(text.find("more than half of the damping of " + std::to_string(strong) + " of 9 modes"), std::string::npos) << text;
  const double cents = 1200.0 * std::log2(std::sqrt(1.0 + mass));
  char figure[32];
  std::snprintf(figure, sizeof figure, "lowers one by %.2g cents", cents);
  EXPECT_NE(text.find(figure), std::string::npos) << text;
  EXPECT_NE(format_info_json(bank, list_heard(bank, {}), file).find("\"worst_error_db\" : -45"), std::string::npos);
  EXPECT_EQ(format_info(example::make_bank(2, 5), list_heard(example::make_bank(2, 5), {}), file, 20, false).find("radiation "),
            std::string::npos);
}

TEST(Info, HeadsFrequenciesWithTheirOrigin) {
  const tests::Folder folder;
  const std::filesystem::path file = folder.path() / "bank.hdf";
  Bank bank = example::make_bank(2, 5);
  write_bank(bank, file);
  for (const auto& [element, head] : {std::pair{"T10", " mesh [Hz] "}, {"analytic", " theory [Hz] "}, {"imported", " imported [Hz] "}}) {
    bank.element = element;
    const std::string text = format_info(bank, list_heard(bank, {}), file, 5, false);
    EXPECT_NE(text.find(head), std::string::npos) << text;
    EXPECT_EQ(text.find("of the mesh\n") == std::string::npos && text.find("+-mesh") == std::string::npos, bank.element != "T10") << text;
  }
}

}  // namespace
}  // namespace carillon::bank
