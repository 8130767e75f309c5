// Packed banks: stated error, invariants, damaged files.
#include "runtime/bank/pack.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <numeric>
#include <random>

#include "runtime/bank/edits.hpp"
#include "runtime/bank/reduce.hpp"
#include "runtime/bank/write.hpp"
#include "tests/support/catch_message.hpp"
#include "tests/support/folder.hpp"
#include "tests/unit/runtime/bank/bank_arrays.hpp"
#include "tests/unit/runtime/bank/example_bank.hpp"
#include "tests/unit/runtime/bank/packed/surfaces.hpp"
#include "tests/unit/runtime/bank/seal_again.hpp"

namespace carillon::bank {
namespace {

/// Steel ball of 100 mm with smooth shapes, optionally fixed for z > 80 mm.
Bank make_ball_bank(int divisions, std::size_t modes, bool is_fixed = false) {
  Bank bank = example::make_first_bank(1, modes);
  const packed::example::Mesh mesh = packed::example::shuffle(packed::example::make_ball(divisions, 0.1), 5);
  bank.vertices_m = mesh.vertices_m;
  bank.triangles = mesh.triangles;
  double six_volumes = 0.0;
  for (const auto& [a, b, c] : mesh.triangles) six_volumes += dot(mesh.vertices_m[a], cross(mesh.vertices_m[b], mesh.vertices_m[c]));
  bank.rigid.volume_m3 = six_volumes / 6.0;
  bank.rigid.mass_kg = 7800.0 * bank.rigid.volume_m3;
  bank.rigid.centre_m = {};
  const double inertia = 0.4 * bank.rigid.mass_kg * 0.01;
  bank.rigid.inertia_kg_m2 = {inertia, 0, 0, 0, inertia, 0, 0, 0, inertia};
  bank.counts.nodes = static_cast<std::int64_t>(bank.vertex_count()) + 1;
  std::vector<double> shapes;
  for (const Vec3& x : bank.vertices_m)
    for (std::size_t m = 0; m < modes; ++m) {
      const double k = 5.0 + 2.0 * static_cast<double>(m), phase = k * (x[0] + 0.4 * x[1] - 0.7 * x[2]) + static_cast<double>(m);
      const double free = is_fixed ? std::clamp((0.08 - x[2]) / 0.1, 0.0, 1.0) : 1.0;
      for (const double value : {std::sin(phase), std::cos(1.2 * phase), 0.5 * std::sin(0.9 * phase + 1.0)}) shapes.push_back(free * value);
    }
  quantise_shapes(bank, shapes);
  bank.proof = example::make_proof(bank);
  return bank;
}

/// Original vertex of each packed one: the only one within a 20,000th of the body's size.
std::vector<std::size_t> find_original(const Bank& packed, const Bank& original, double size_m) {
  std::vector<std::size_t> from;
  for (const Vec3& x : packed.vertices_m) {
    std::size_t found = original.vertex_count(), count = 0;
    for (std::size_t v = 0; v < original.vertex_count(); ++v)
      if (norm(x - original.vertices_m[v]) < size_m / 20000.0) found = v, ++count;
    EXPECT_EQ(count, 1u);
    from.push_back(found);
  }
  return from;
}

struct Error {
  double of_95_percent_db, worst_db;
};

/// Independent calculation, for a bank whose whole surface faces the air.
Error calc_error(const Bank& packed, const Bank& original, double size_m) {
  const std::vector<std::size_t> from = find_original(packed, original, size_m);
  const std::vector<double> exposure = calc_blow_exposure(original);
  std::vector<Vec3> normals(packed.vertex_count(), Vec3{});
  std::vector<double> areas(packed.vertex_count(), 0.0);
  for (const auto& [a, b, c] : packed.triangles) {
    const Vec3 twice = cross(packed.vertices_m[b] - packed.vertices_m[a], packed.vertices_m[c] - packed.vertices_m[a]);
    for (const std::int32_t v : {a, b, c}) {
      normals[v] = normals[v] + twice;
      areas[v] += norm(twice) / 6.0;
    }
  }
  // Blow three degrees off the normal; floor at 2^-20 of the loudest place.
  const auto weigh = [&](const Vec3& x, const Vec3& n) { return std::pow(dot(x, n), 2) + 0.0027 * dot(x, x); };
  std::vector<double> heard(packed.vertex_count(), 0.0), missed(packed.vertex_count(), 0.0);
  for (std::size_t v = 0; v < packed.vertex_count(); ++v) {
    const Vec3 n = normalise(normals[v]);
    for (std::size_t m = 0; m < packed.mode_count(); ++m) {
      const Vec3 was = original.shape_at(from[v], m), is = packed.shape_at(v, m);
      heard[v] += exposure[m] * weigh(was, n);
      missed[v] += exposure[m] * weigh(is - was, n);
    }
  }
  const double quietest = *std::max_element(heard.begin(), heard.end()) / 1048576.0;
  std::vector<std::pair<double, double>> errors;
  double all = 0.0;
  for (std::size_t v = 0; v < packed.vertex_count(); ++v) {
    errors.emplace_back(missed[v] > 0.0 ? 10.0 * std::log10(missed[v] / std::max(heard[v], quietest)) : -200.0, areas[v]);
    all += areas[v];
  }
  std::sort(errors.begin(), errors.end());
  double below = 0.0;
  std::size_t i = 0;
  while (below + errors[i].second < 0.95 * all) below += errors[i++].second;
  return {errors[i].first, errors.back().first};
}

void expect_stated_error(const Bank& bank, double size_m) {
  ASSERT_EQ(find_faults(bank), std::vector<std::string>{});
  std::size_t before = 0;
  for (const double asked_db : {-20.0, -40.0, -60.0}) {
    const PackedBank packed = calc_packed(bank, asked_db);
    ASSERT_TRUE(packed.bank.packing.has_value());
    EXPECT_LE(packed.bank.packing->error_db, asked_db);
    EXPECT_GT(packed.bank.packing->error_db, asked_db - 6.0);
    const Error error = calc_error(packed.bank, bank, size_m);
    EXPECT_NEAR(packed.bank.packing->error_db, error.of_95_percent_db, 0.02) << asked_db;
    EXPECT_NEAR(packed.bank.packing->worst_db, error.worst_db, 0.02) << asked_db;
    EXPECT_EQ(find_faults(packed.bank), std::vector<std::string>{});
    EXPECT_GT(packed.shape.size(), before) << asked_db;
    before = packed.shape.size();
  }
}

TEST(Pack, error_of_a_box_is_as_stated) { expect_stated_error(example::make_bank(6, 9), 0.3); }

TEST(Pack, error_of_a_ball_is_as_stated) { expect_stated_error(make_ball_bank(4, 20), 0.2); }

TEST(Pack, by_default_leaves_small_packed_and_faulty_banks_as_they_are) {
  std::string why;
  EXPECT_FALSE(try_packed(make_ball_bank(3, 20), why));
  EXPECT_EQ(why, "below 1 MB");
  Bank bank = make_ball_bank(5, 30);
  why.clear();
  const std::optional<PackedBank> packed = try_packed(bank, why);
  ASSERT_TRUE(packed) << why;
  EXPECT_LE(packed->bank.packing->error_db, kPackError);
  EXPECT_FALSE(try_packed(packed->bank, why));
  EXPECT_EQ(why, "packed already");
  bank.shape_scale[3] = std::numeric_limits<double>::quiet_NaN();
  why.clear();
  EXPECT_FALSE(try_packed(bank, why));
  EXPECT_EQ(why, "the bank has faults");
}

TEST(Pack, small_banks_and_single_modes_have_the_requested_error) {
  for (const int n : {1, 2, 3})
    for (const std::size_t modes : {1u, 5u, 16u})
      for (const double asked_db : {kMinPackError, -70.0, -33.0, kMaxPackError}) {
        const Bank bank = example::make_bank(n, modes);
        const PackedBank packed = calc_packed(bank, asked_db);
        EXPECT_LE(calc_error(packed.bank, bank, 0.3).of_95_percent_db, asked_db + 0.02) << n << " " << modes;
      }
}

TEST(Pack, a_ball_is_compressed_to_a_fifth) {
  const Bank bank = make_ball_bank(4, 30);
  const std::size_t raw = make_bank_bytes(bank).size();
  const std::size_t coarse = make_packed_bytes(calc_packed(bank, -30.0)).size(), fine = make_packed_bytes(calc_packed(bank, -50.0)).size();
  EXPECT_LT(5 * fine, raw);
  EXPECT_LT(coarse, fine);
}

// Conserved: total audible energy of blows, triangles, area and volume.
TEST(Pack, conserves_audible_energy_and_volume) {
  const Bank bank = make_ball_bank(3, 9);
  const auto calc_volume_m3 = [](const Bank& of) {
    double six = 0.0;
    for (const auto& [a, b, c] : of.triangles) six += dot(of.vertices_m[a], cross(of.vertices_m[b], of.vertices_m[c]));
    return six / 6.0;
  };
  const auto calc_heard = [](const Bank& of) {
    const std::vector<double> heard = calc_audibility(of);
    return std::accumulate(heard.begin(), heard.end(), 0.0);
  };
  for (const double asked_db : {-30.0, -50.0, -70.0}) {
    const Bank packed = calc_packed(bank, asked_db).bank;
    EXPECT_EQ(packed.triangles.size(), bank.triangles.size());
    EXPECT_EQ(packed.vertex_count(), bank.vertex_count());
    EXPECT_EQ(packed.mode_count(), bank.mode_count());
    EXPECT_NEAR(calc_volume_m3(packed) / calc_volume_m3(bank), 1.0, 1e-5);
    // |E' - E| <= 2 sqrt(E e) + e, with e the error over all places.
    const double error = std::pow(10.0, packed.packing->worst_db / 20.0);
    EXPECT_NEAR(calc_heard(packed) / calc_heard(bank), 1.0, 2.0 * error + error * error) << asked_db;
  }
}

// Places at rest must remain inaudible.
TEST(Pack, fixed_places_stay_at_rest) {
  const Bank bank = make_ball_bank(3, 9, true);
  ASSERT_EQ(find_faults(bank), std::vector<std::string>{});
  for (const double asked_db : {-30.0, -60.0, -80.0}) {
    const PackedBank packed = calc_packed(bank, asked_db);
    EXPECT_LT(packed.bank.packing->worst_db, asked_db + 20.0);
    for (std::size_t v = 0; v < packed.bank.vertex_count(); ++v)
      for (std::size_t i = 0; packed.bank.vertices_m[v][2] > 0.0801 && i < 27; ++i)
        ASSERT_LE(std::abs(packed.bank.shape[27 * v + i]), 33) << v;  // a thousandth of the largest
    EXPECT_EQ(check_packing(packed.bank).faults, std::vector<std::string>{});
  }
}

TEST(Pack, walls_of_cavities_are_accurate) {
  Bank bank = make_ball_bank(3, 5);
  const auto outer = static_cast<std::int32_t>(bank.vertex_count());
  const std::size_t triangles = bank.triangles.size();
  for (std::int32_t v = 0; v < outer; ++v) {
    bank.vertices_m.push_back(0.5 * bank.vertices_m[v]);
    for (std::size_t i = 0; i < 15; ++i) bank.shape.push_back(bank.shape[15 * v + i]);
  }
  for (std::size_t t = 0; t < triangles; ++t) {
    const auto [a, b, c] = bank.triangles[t];
    bank.triangles.push_back({outer + a, outer + c, outer + b});
  }
  const PackedBank packed = calc_packed(bank, -40.0);
  EXPECT_LE(packed.bank.packing->error_db, -40.0);
  double heard = 0.0, missed = 0.0;
  const std::vector<std::size_t> from = find_original(packed.bank, bank, 0.2);
  for (std::size_t v = 0; v < packed.bank.vertex_count(); ++v) {
    if (norm(packed.bank.vertices_m[v]) > 0.07) continue;
    for (std::size_t m = 0; m < 5; ++m) {
      heard += std::pow(norm(bank.shape_at(from[v], m)), 2);
      missed += std::pow(norm(packed.bank.shape_at(v, m) - bank.shape_at(from[v], m)), 2);
    }
  }
  EXPECT_LT(10.0 * std::log10(missed / heard), -20.0);
  for (const std::int32_t v : packed.bank.packing->witness) EXPECT_GT(norm(packed.bank.vertices_m[v]), 0.09);
}

// ---- files ----

void expect_same(const Bank& a, const Bank& b) {
  EXPECT_EQ(make_bank_bytes(a), make_bank_bytes(b));  // except the packing
  EXPECT_EQ(a.shape, b.shape);
  EXPECT_EQ(a.shape_bytes, b.shape_bytes);
  EXPECT_EQ(a.vertices_m, b.vertices_m);
  EXPECT_EQ(a.triangles, b.triangles);
  ASSERT_EQ(a.packing.has_value(), b.packing.has_value());
  if (!a.packing) return;
  EXPECT_EQ(a.packing->error_db, b.packing->error_db);
  EXPECT_EQ(a.packing->worst_db, b.packing->worst_db);
  EXPECT_EQ(a.packing->witness, b.packing->witness);
  EXPECT_EQ(a.packing->witness_shape, b.packing->witness_shape);
}

TEST(Pack, a_file_gives_the_bank_that_the_packer_predicts) {
  const tests::Folder folder;
  const std::filesystem::path file = folder.path() / "packed.hdf";
  for (const Bank& bank : {example::make_bank(3, 7), example::make_first_bank(1, 2), example::make_corrected_bank(2, 9),
                           example::make_supported_bank(2, 5), make_ball_bank(3, 17)}) {
    const PackedBank packed = calc_packed(bank, -40.0);
    const std::string bytes = make_packed_bytes(packed);
    expect_same(parse_bank(bytes_of(bytes)), packed.bank);
    write_packed_bank(packed, file);
    expect_same(read_bank(file), packed.bank);
    EXPECT_EQ(read_version(file), (std::array{2, 0}));
  }
}

TEST(Pack, triangle_numbers_are_kept_on_request) {
  const Bank bank = make_ball_bank(2, 5);
  const PackedBank packed = calc_packed(bank, -40.0, true);
  const std::vector<std::size_t> from = find_original(packed.bank, bank, 0.2);
  ASSERT_EQ(packed.bank.triangles.size(), bank.triangles.size());
  for (std::size_t t = 0; t < bank.triangles.size(); ++t)
    for (std::size_t k = 0; k < 3; ++k) ASSERT_EQ(from[packed.bank.triangles[t][k]], static_cast<std::size_t>(bank.triangles[t][k])) << t;
  const Bank read = parse_bank(bytes_of(make_packed_bytes(packed)));
  expect_same(read, packed.bank);
  EXPECT_NEAR(compare_packed(read, bank).error_db, packed.bank.packing->error_db, 1e-6);
  PackedBank bad = packed;
  bad.order = calc_packed(make_ball_bank(1, 5), -40.0, true).order;
  EXPECT_THROW(parse_bank(bytes_of(make_packed_bytes(bad))), InputError);
}

TEST(Pack, other_arrays_are_unchanged) {
  Bank bank = example::make_supported_bank(2, 9);
  bank.corrected = example::make_corrected_bank(2, 9).corrected;
  Bank packed = calc_packed(bank, -30.0).bank;
  EXPECT_EQ(packed.triangles.size(), bank.triangles.size());
  EXPECT_NE(packed.provenance.find(R"({"packed": {"error_db": -3)"), std::string::npos) << packed.provenance;
  EXPECT_NE(packed.provenance.find(R"("of": )" + bank.provenance), std::string::npos);
  packed.vertices_m = bank.vertices_m;
  packed.triangles = bank.triangles;
  packed.shape = bank.shape;
  packed.provenance = bank.provenance;
  packed.packing.reset();
  EXPECT_EQ(make_bank_bytes(packed), make_bank_bytes(bank));
}

TEST(Pack, unused_vertices_are_removed) {
  Bank bank = example::make_bank(2, 5);
  const std::size_t used = bank.vertex_count();
  bank.vertices_m.insert(bank.vertices_m.begin() + 3, bank.vertices_m[0]);
  bank.shape.insert(bank.shape.begin() + 3 * 15, 15, 32767);
  bank.vertices_m.push_back(bank.vertices_m[1]);
  bank.shape.resize(bank.shape.size() + 15, 32767);
  for (auto& triangle : bank.triangles)
    for (std::int32_t& v : triangle) v += v >= 3 ? 1 : 0;
  const PackedBank packed = calc_packed(bank, -40.0);
  EXPECT_EQ(packed.bank.vertex_count(), used);
  EXPECT_LE(calc_error(packed.bank, example::make_bank(2, 5), 0.3).of_95_percent_db, -40.0);
  EXPECT_NEAR(compare_packed(packed.bank, bank).error_db, packed.bank.packing->error_db, 1e-6);
}

TEST(Pack, coarse_shapes_and_modes_at_rest_are_packed) {
  Bank bank = calc_reduced(example::make_bank(3, 6), {.shape_bits = 8});
  ASSERT_EQ(bank.shape_bytes, 1);
  for (std::size_t v = 0; v < bank.vertex_count(); ++v)
    for (std::size_t c = 0; c < 3; ++c) bank.shape[(v * 6 + 2) * 3 + c] = 0;
  bank.shape_scale[2] = bank.radiation_gain[2] = 0.0;
  ASSERT_EQ(find_faults(bank), std::vector<std::string>{});
  for (const double asked_db : {-25.0, -50.0, -90.0}) {
    const PackedBank packed = calc_packed(bank, asked_db);
    EXPECT_LE(calc_error(packed.bank, bank, 0.3).of_95_percent_db, asked_db + 0.02);
    expect_same(parse_bank(bytes_of(make_packed_bytes(packed))), packed.bank);
  }
}

TEST(Pack, a_packed_bank_can_be_packed_again) {
  const Bank bank = make_ball_bank(3, 9);
  const Bank once = parse_bank(bytes_of(make_packed_bytes(calc_packed(bank, -50.0))));
  const PackedBank twice = calc_packed(once, -30.0);
  expect_same(parse_bank(bytes_of(make_packed_bytes(twice))), twice.bank);
  EXPECT_LE(calc_error(twice.bank, once, 0.2).of_95_percent_db, -30.0);
  EXPECT_LE(calc_error(twice.bank, bank, 0.2).of_95_percent_db, -29.0);
  EXPECT_GT(make_packed_bytes(calc_packed(bank, -50.0)).size(), make_packed_bytes(twice).size());
}

TEST(Pack, edits_drop_the_packing) {
  const Bank packed = calc_packed(example::make_bank(2, 5), -40.0).bank;
  ASSERT_TRUE(packed.packing.has_value());
  EXPECT_FALSE(calc_reduced(packed, {.modes = 3}).packing.has_value());
  EXPECT_FALSE(calc_reduced(packed, {.shape_bits = 8}).packing.has_value());
  EXPECT_FALSE(calc_edited(packed, {.size_scale = 2.0}).packing.has_value());
  EXPECT_FALSE(parse_bank(bytes_of(make_bank_bytes(packed))).packing.has_value());
}

TEST(Pack, the_error_is_reproduced_from_the_original) {
  const Bank bank = make_ball_bank(3, 9);
  const Bank packed = parse_bank(bytes_of(make_packed_bytes(calc_packed(bank, -40.0))));
  const Packing found = compare_packed(packed, bank);
  EXPECT_NEAR(found.error_db, packed.packing->error_db, 1e-6);
  EXPECT_NEAR(found.worst_db, packed.packing->worst_db, 1e-6);
  EXPECT_TRUE(found.witness.empty());
  EXPECT_THROW(compare_packed(packed, make_ball_bank(2, 9)), InputError);
  EXPECT_THROW(compare_packed(packed, make_ball_bank(3, 8)), InputError);
  Bank moved = bank;
  moved.vertices_m[7][1] += 1e-3;
  EXPECT_THROW(compare_packed(packed, moved), InputError);
  Bank louder = packed;
  for (std::int16_t& steps : louder.shape) steps = static_cast<std::int16_t>(steps / 2);
  EXPECT_NEAR(compare_packed(louder, bank).error_db, -6.0, 0.5);
}

TEST(Pack, witnesses_detect_other_shapes) {
  const Bank packed = calc_packed(make_ball_bank(3, 9), -40.0).bank;
  const std::vector<std::int32_t>& witness = packed.packing->witness;
  EXPECT_EQ(witness.size(), 24u);
  EXPECT_TRUE(std::is_sorted(witness.begin(), witness.end()));
  const Check good = check_packing(packed);
  EXPECT_EQ(good.property, "packing");
  EXPECT_EQ(good.faults, std::vector<std::string>{});
  EXPECT_NE(good.figure.find("error at most -40."), std::string::npos) << good.figure;
  EXPECT_NE(good.figure.find("of 24 witnesses"), std::string::npos) << good.figure;

  Bank one = packed;
  for (std::size_t i = 0; i < 27; ++i) one.shape[27 * static_cast<std::size_t>(witness[5]) + i] /= 2;
  ASSERT_EQ(check_packing(one).faults.size(), 1u);
  EXPECT_NE(check_packing(one).faults[0].find("at vertex " + std::to_string(witness[5])), std::string::npos);

  Bank all = packed;
  all.packing->worst_db = 0.0;
  for (std::int16_t& steps : all.shape) steps = static_cast<std::int16_t>(steps - steps / 8);
  ASSERT_EQ(check_packing(all).faults.size(), 1u);
  EXPECT_NE(check_packing(all).faults[0].find("of 24 witnesses"), std::string::npos);

  Bank better = packed;
  better.packing->error_db = better.packing->worst_db = -60.0;
  EXPECT_GT(check_packing(better).faults.size(), 20u);
}

TEST(Pack, contradicting_witnesses_are_rejected) {
  const Bank bank = make_ball_bank(3, 9);
  PackedBank packed = calc_packed(bank, -60.0);
  EXPECT_NO_THROW((void)parse_bank(bytes_of(make_packed_bytes(packed))));
  packed.shape = calc_packed(bank, -12.0).shape;  // with the errors and witnesses of the finer packing
  tests::expect_error<InputError>({"not a valid bank: the error is"}, [&] { (void)parse_bank(bytes_of(make_packed_bytes(packed))); });
}

TEST(Pack, a_bank_without_modes_has_nothing_to_check) {
  Bank bank = example::make_bank(2, 0);
  bank.packing = Packing{-40.0, -30.0, {1, 2}, {}};
  EXPECT_EQ(check_packing(bank).faults, std::vector<std::string>{});
}

TEST(Pack, invalid_requests_are_rejected) {
  const Bank bank = example::make_bank(2, 5);
  for (const double asked_db : {kMinPackError - 0.1, kMaxPackError + 0.1, 0.0, 60.0, std::nan(""), -HUGE_VAL})
    EXPECT_THROW(calc_packed(bank, asked_db), InputError) << asked_db;
  EXPECT_THROW(calc_packed(example::make_bank(2, 0), -40.0), InputError);
}

TEST(Pack, is_described_in_words) {
  EXPECT_EQ(describe(Packing{-60.24, -57.06, {}, {}}), "error at most -60.2 dB(A) on 95 % of the surface, -57.1 at the worst place");
}

// ---- damaged files ----

/// False if the bytes are rejected.
bool try_read(std::string_view bytes) {
  try {
    const Bank bank = parse_bank(bytes_of(bytes));
    EXPECT_EQ(find_faults(bank), std::vector<std::string>{});
    if (bank.packing) check_packing(bank);
    return true;
  } catch (const InputError&) {
    return false;
  }
}

TEST(Pack, damaged_files_are_rejected_or_valid) {
  const std::string bytes = make_packed_bytes(calc_packed(example::make_bank(2, 5), -40.0));
  ASSERT_TRUE(try_read(bytes));
  ASSERT_TRUE(try_read(seal_again(bytes)));
  std::mt19937 random(17);
  std::size_t sane = 0;
  for (int round = 0; round < 600; ++round) {
    const std::size_t length = random() % bytes.size();
    EXPECT_FALSE(try_read(std::string_view(bytes).substr(0, length))) << length;
    try_read(seal_again(bytes.substr(0, length)));
    std::string changed = bytes;
    const std::size_t at = random() % bytes.size();
    changed[at] = static_cast<char>(changed[at] ^ (1 << random() % 8));
    EXPECT_FALSE(try_read(changed)) << at;
    sane += try_read(seal_again(changed)) ? 1 : 0;
  }
  EXPECT_GT(sane, 50u);  // HDF5's own structure is not checked
  EXPECT_LT(sane, 600u);
}

// Bit flips inside the two packed arrays only.
TEST(Pack, damaged_surfaces_and_shapes_are_rejected_or_valid) {
  const PackedBank packed = calc_packed(example::make_bank(2, 5), -40.0);
  std::mt19937 random(18);
  std::size_t refused = 0;
  for (int round = 0; round < 400; ++round) {
    PackedBank bad = packed;
    std::vector<std::uint8_t>& part = round % 2 == 0 ? bad.surface : bad.shape;
    if (round % 8 < 6)
      part[random() % part.size()] ^= static_cast<std::uint8_t>(1U << random() % 8);
    else
      part.resize(random() % part.size());
    refused += try_read(make_packed_bytes(bad)) ? 0 : 1;
  }
  EXPECT_GT(refused, 300u);
  for (const std::int32_t vertex : {-1, static_cast<std::int32_t>(packed.bank.vertex_count()), 1 << 30}) {
    PackedBank bad = packed;
    bad.bank.packing->witness[2] = vertex;
    EXPECT_THROW((void)make_packed_bytes(bad), InputError) << vertex;
  }
  PackedBank of_other = packed;
  of_other.shape = calc_packed(example::make_bank(2, 6), -40.0).shape;
  EXPECT_FALSE(try_read(make_packed_bytes(of_other)));
  of_other = packed;
  of_other.surface = calc_packed(example::make_bank(3, 5), -40.0).surface;
  EXPECT_FALSE(try_read(make_packed_bytes(of_other)));
}

}  // namespace
}  // namespace carillon::bank
