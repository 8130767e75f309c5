// Sensitivities: closed form of a longitudinal mode, pairs, doubtful sites, files.
#include "runtime/bank/sensitivities.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <numbers>
#include <numeric>
#include <string>

#include "runtime/bank/edits.hpp"
#include "runtime/bank/pack.hpp"
#include "runtime/bank/select.hpp"
#include "runtime/bank/write.hpp"
#include "tests/support/folder.hpp"
#include "tests/unit/runtime/bank/bank_arrays.hpp"
#include "tests/unit/runtime/bank/example_bank.hpp"

namespace carillon::bank {
namespace {

constexpr double kYoungPa = 70e9, kDensity = 2700.0, kLengthM = example::kSidesM[0];
constexpr double kCentPerMm = 600.0 / std::numbers::ln2 * 1e-3;

/// Cuts each triangle into four, in the order of six-node faces.
void refine(Bank& bank) {
  std::map<std::pair<std::int32_t, std::int32_t>, std::int32_t> middles;
  const auto find_middle = [&](std::int32_t a, std::int32_t b) {
    const auto [entry, added] = middles.try_emplace(std::minmax(a, b), static_cast<std::int32_t>(bank.vertices_m.size()));
    if (added) bank.vertices_m.push_back(0.5 * (bank.vertices_m[a] + bank.vertices_m[b]));
    return entry->second;
  };
  std::vector<std::array<std::int32_t, 3>> fine;
  for (const auto& [a, b, c] : bank.triangles) {
    const std::int32_t ab = find_middle(a, b), bc = find_middle(b, c), ca = find_middle(c, a);
    fine.insert(fine.end(), {{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}});
  }
  bank.triangles = fine;
}

material::Elasticity make_elasticity(double poisson_ratio) {
  material::Material material;
  material.young_modulus_pa = kYoungPa;
  material.poisson_ratio = poisson_ratio;
  return material.calc_elasticity_pa();
}

/// Box with modes whose shapes are given, of eigenvalue `lambda` times 1, 1 + apart, ...
Bank make_box(int n, bool is_quadratic, std::size_t modes, double lambda, double apart,
              const std::function<Vec3(std::size_t, const Vec3&)>& find) {
  Bank bank = example::make_first_bank(n, modes);
  if (is_quadratic) refine(bank);
  for (std::size_t m = 0; m < modes; ++m) {
    bank.eigenvalue_rad2_s2[m] = lambda * (1.0 + apart * static_cast<double>(m));
    bank.decay_per_s[m] = (bank.material.alpha1_s * bank.eigenvalue_rad2_s2[m] + bank.material.alpha2_per_s) / 2.0;
  }
  bank.counts.nodes = static_cast<std::int64_t>(bank.vertex_count()) + 1;
  std::vector<double> shapes;
  for (const Vec3& x : bank.vertices_m)
    for (std::size_t m = 0; m < modes; ++m)
      for (const double u : find(m, x - example::kCornerM)) shapes.push_back(u);
  quantise_shapes(bank, shapes);
  return bank;
}

/// Longitudinal mode `half_waves` of a rod without Poisson's effect, an exact mode of the box: cos(k x) along x.
Bank make_rod(int n, bool is_quadratic, double half_waves) {
  const double k = half_waves * std::numbers::pi / kLengthM;
  return make_box(n, is_quadratic, 1, k * k * kYoungPa / kDensity, 0.0, [k](std::size_t, const Vec3& x) {
    return Vec3{std::cos(k * x[0]), 0.0, 0.0};
  });
}

/// Largest error of the densities, over the largest density.
double find_error(const Bank& bank, double half_waves) {
  const Sensitivities s = calc_sensitivities(bank, make_elasticity(0.0), kDensity, 1, {});
  const double k = half_waves * std::numbers::pi / kLengthM, most = kCentPerMm * kDensity;
  double worst = 0.0;
  for (std::size_t site = 0; site < s.site_count(); ++site) {
    const double x = bank.vertices_m[s.vertex[site]][0] - example::kCornerM[0];
    const bool is_end = std::abs(s.normal[site][0]) > 0.5F;
    worst = std::max(worst, std::abs(s.get_density(site, 0) - most * (is_end ? 1.0 : std::cos(2.0 * k * x))) / most);
  }
  return worst;
}

TEST(Sensitivities, OfALongitudinalModeAreTheClosedForm) {
  const double coarse = find_error(make_rod(24, true, 1.0), 1.0), fine = find_error(make_rod(48, true, 1.0), 1.0);
  EXPECT_LT(coarse, 0.025);
  EXPECT_LT(fine, 0.6 * coarse);  // of first order at the ends of a side, where the triangles around a site are on one side of it
  EXPECT_LT(find_error(make_rod(24, true, 2.0), 2.0), 0.05);
  EXPECT_LT(find_error(make_rod(96, false, 1.0), 1.0), 0.05);
}

TEST(Sensitivities, OfAnEvenCutAreThatOfALongerOrThinnerRod) {
  const Bank rod = make_rod(24, true, 1.0);
  Bank bank = rod;
  bank.sensitivities = calc_sensitivities(bank, make_elasticity(0.0), kDensity, 1, {});
  const Sensitivities& s = bank.sensitivities;
  std::vector<double> sides(s.site_count()), ends(s.site_count());
  for (std::size_t site = 0; site < s.site_count(); ++site) (std::abs(s.normal[site][0]) > 0.5F ? ends : sides)[site] = 0.1;
  EXPECT_NEAR(calc_changes(bank, sides)[0], 0.0, 1e-3);  // a thinner rod has the same frequency
  // Mass-normalised shapes have the amplitude sqrt(2 / mass); these have 1.
  const double amplitude = 2.0 / (kDensity * kLengthM * example::kSidesM[1] * example::kSidesM[2]);
  EXPECT_NEAR(amplitude * calc_changes(bank, ends)[0], 1200.0 / std::numbers::ln2 * 0.2e-3 / kLengthM, 1e-3);
}

TEST(Sensitivities, SitesCoverTheSurfaceOnceForEachSideOfAnEdge) {
  for (const bool is_quadratic : {false, true}) {
    const Bank bank = make_rod(4, is_quadratic, 1.0);
    const Sensitivities s = calc_sensitivities(bank, make_elasticity(0.3), kDensity, 1, {});
    const std::size_t n = is_quadratic ? 8 : 4;
    EXPECT_EQ(s.site_count(), 6 * (n + 1) * (n + 1));  // the sides share no site
    const auto [a, b, c] = example::kSidesM;
    EXPECT_NEAR(std::accumulate(s.area_m2.begin(), s.area_m2.end(), 0.0), 2 * (a * b + b * c + c * a), 1e-8);
    for (std::size_t site = 0; site < s.site_count(); ++site) {
      const auto& normal = s.normal[site];
      EXPECT_NEAR(std::max({std::abs(normal[0]), std::abs(normal[1]), std::abs(normal[2])}), 1.0F, 1e-6F);
      EXPECT_GT(s.area_m2[site], 0.0F);
    }
    EXPECT_EQ(std::count(s.doubtful.begin(), s.doubtful.end(), 1), 0);
  }
}

TEST(Sensitivities, OfAPairDoNotDependOnItsBasis) {
  const double k = std::numbers::pi / kLengthM, lambda = k * k * kYoungPa / kDensity;
  for (const double angle : {0.0, 0.4, 1.1}) {
    const auto find = [&](std::size_t m, const Vec3& x) {
      const double phase = angle + (m == 0 ? 0.0 : std::numbers::pi / 2);
      return Vec3{0.0, std::cos(phase) * std::sin(k * x[0]), std::sin(phase) * std::sin(2 * k * x[0])};
    };
    Bank bank = make_box(12, true, 2, lambda, 1e-12, find);
    bank.sensitivities = calc_sensitivities(bank, make_elasticity(0.3), kDensity, 2, {});
    ASSERT_EQ(bank.sensitivities.column_count(), 3u);
    std::vector<double> depth(bank.sensitivities.site_count());
    for (std::size_t site = 0; site < depth.size(); ++site)
      depth[site] = std::max(0.0, 0.1 - std::abs(bank.vertices_m[bank.sensitivities.vertex[site]][0] - example::kCornerM[0] - 0.08));
    const std::vector<double> changes = calc_changes(bank, depth);
    static std::vector<double> first;
    if (angle == 0.0) first = changes;
    EXPECT_GT(std::abs(changes[1] - changes[0]), 1e-4);
    for (std::size_t m = 0; m < 2; ++m) EXPECT_NEAR(changes[m], first[m], 1e-3 * std::abs(first[m])) << angle;
  }
}

TEST(Sensitivities, AreDoubtfulNearFixedNodesAndInwardEdgesOnly) {
  Bank bank = make_rod(16, true, 1.0);
  std::vector<std::uint8_t> fixed;
  for (const Vec3& x : bank.vertices_m) fixed.push_back(x[0] < example::kCornerM[0] + 1e-9 ? 1 : 0);
  const double edge = kLengthM / 16;
  const Sensitivities clamped = calc_sensitivities(bank, make_elasticity(0.3), kDensity, 1, fixed);
  for (std::size_t site = 0; site < clamped.site_count(); ++site) {
    const double x = bank.vertices_m[clamped.vertex[site]][0] - example::kCornerM[0];
    if (x < 1.9 * edge) {
      EXPECT_EQ(clamped.doubtful[site], 1) << x;
    }
    if (x > 3.1 * edge) {
      EXPECT_EQ(clamped.doubtful[site], 0) << x;
    }
  }
  // An angle: the cross-section turns inwards at (1, 1) cm.
  const std::vector<Vec3> section{{0, 0, 0}, {0.03, 0, 0}, {0.03, 0.01, 0}, {0.01, 0.01, 0}, {0.01, 0.03, 0}, {0, 0.03, 0}};
  bank.vertices_m.clear();
  bank.triangles.clear();
  for (const double z : {0.0, 0.04})
    for (const Vec3& x : section) bank.vertices_m.push_back({x[0], x[1], z});
  for (std::int32_t i = 0; i < 6; ++i) {
    const std::int32_t next = (i + 1) % 6;
    bank.triangles.insert(bank.triangles.end(), {{i, next, next + 6}, {i, next + 6, i + 6}});
  }
  for (std::int32_t i = 4; i < 8; ++i) {  // fans around the inward corner
    const std::int32_t a = i % 6, b = (i + 1) % 6;
    bank.triangles.insert(bank.triangles.end(), {{3, b, a}, {9, a + 6, b + 6}});
  }
  for (int i = 0; i < 4; ++i) refine(bank);
  std::vector<double> still(3 * bank.vertex_count(), 1.0);
  quantise_shapes(bank, still);
  const Sensitivities angle = calc_sensitivities(bank, make_elasticity(0.3), kDensity, 1, {});
  for (std::size_t site = 0; site < angle.site_count(); ++site) {
    const Vec3& x = bank.vertices_m[angle.vertex[site]];
    const double distance = std::hypot(x[0] - 0.01, x[1] - 0.01);
    if (distance < 1e-9) {
      EXPECT_EQ(angle.doubtful[site], 1);
    }
    if (distance > 0.02) {
      EXPECT_EQ(angle.doubtful[site], 0);
    }
  }
}

// A floor that rises at an angle from x = 0 on is inward there; a floor of an arc of as many degrees an edge is smooth.
TEST(Sensitivities, AreDoubtfulNearBluntInwardEdgesButNotOnSmoothSurfaces) {
  for (const double angle_deg : {10.0, 20.0, 45.0}) {
    for (const bool is_arc : {false, true}) {
      const auto find_height = [&](int i) {  // at x = i
        double height = 0.0;
        for (int k = -2; k < i; ++k) {
          const double slope_deg = is_arc ? (k + 0.5) * angle_deg : k < 0 ? 0.0 : angle_deg;
          height += std::tan(slope_deg * std::numbers::pi / 180.0);
        }
        return height;
      };
      Bank bank = make_rod(4, false, 1.0);
      bank.vertices_m.clear();
      bank.triangles.clear();
      for (int i = -2; i <= 2; ++i)
        for (const double y : {0.0, 1.0})
          for (const double z : {find_height(i), -9.0}) bank.vertices_m.push_back({1.0 * i, y, z});
      const auto add = [&](std::int32_t a, std::int32_t b, std::int32_t c, std::int32_t d) {
        bank.triangles.insert(bank.triangles.end(), {{a, b, c}, {a, c, d}});
      };
      for (std::int32_t v = 0; v < 16; v += 4) {  // top, bottom, both sides
        add(v, v + 4, v + 6, v + 2);
        add(v + 1, v + 3, v + 7, v + 5);
        add(v, v + 1, v + 5, v + 4);
        add(v + 2, v + 6, v + 7, v + 3);
      }
      add(0, 2, 3, 1);
      add(16, 17, 19, 18);
      quantise_shapes(bank, std::vector<double>(3 * bank.vertex_count(), 1.0));
      const Sensitivities s = calc_sensitivities(bank, make_elasticity(0.3), kDensity, 1, {});
      const bool is_doubtful = std::count(s.doubtful.begin(), s.doubtful.end(), 1) > 0;
      EXPECT_EQ(is_doubtful, !is_arc && angle_deg > 15.0) << angle_deg << " degrees, arc " << is_arc;
    }
  }
}

TEST(Sensitivities, ReadBackAndArePackedAndScaledWithTheBank) {
  Bank bank = example::make_bank(8, 6);
  bank.sensitivities = calc_sensitivities(bank, make_elasticity(0.3), kDensity, 4, {});
  bank.sensitivities.parameters = R"(["size"])";
  bank.sensitivities.by_parameter.assign(4, -1.0);
  bank.sensitivities.own_error_cents = {0.5, 1.0, std::numeric_limits<double>::infinity(), 2.0};
  ASSERT_EQ(find_faults(bank), std::vector<std::string>());
  const tests::Folder folder;
  write_bank(bank, folder.path() / "bank.hdf");
  EXPECT_EQ(read_version(folder.path() / "bank.hdf"), (std::array{1, 9}));
  const Bank read = read_bank(folder.path() / "bank.hdf");
  EXPECT_EQ(read.sensitivities.density, bank.sensitivities.density);
  EXPECT_EQ(read.sensitivities.modes, bank.sensitivities.modes);
  EXPECT_EQ(read.sensitivities.parameters, bank.sensitivities.parameters);
  EXPECT_EQ(read.sensitivities.own_error_cents, bank.sensitivities.own_error_cents);

  const PackedBank packed = calc_packed(bank, -40.0, true);
  write_packed_bank(packed, folder.path() / "packed.hdf");
  EXPECT_EQ(read_version(folder.path() / "packed.hdf"), (std::array{2, 5}));
  const Bank unpacked = read_bank(folder.path() / "packed.hdf");
  EXPECT_EQ(unpacked.sensitivities.density, bank.sensitivities.density);
  for (std::size_t site = 0; site < bank.sensitivities.site_count(); ++site)
    EXPECT_LT(norm(unpacked.vertices_m[unpacked.sensitivities.vertex[site]] - bank.vertices_m[bank.sensitivities.vertex[site]]), 1e-5);

  Bank low = bank;
  keep_lowest(low, 3);
  EXPECT_EQ(low.sensitivities.count, 3u);
  EXPECT_EQ(find_faults(low), std::vector<std::string>());
  Edits twice;
  twice.size_scale = 2.0;
  const Bank large = calc_edited(bank, twice);
  EXPECT_NEAR(large.sensitivities.scale[0], bank.sensitivities.scale[0] / 8.0, 1e-12 * bank.sensitivities.scale[0]);
  const std::vector<double> depth(bank.sensitivities.site_count(), 0.1), deep(depth.size(), 0.2);
  EXPECT_NEAR(calc_changes(large, deep)[0], calc_changes(bank, depth)[0], 1e-5 * std::abs(calc_changes(bank, depth)[0]));
}

TEST(Sensitivities, EditsCutSpotsOnOneSide) {
  const double k = std::numbers::pi / kLengthM;
  Bank bank = make_box(24, true, 2, k * k * kYoungPa / kDensity, 3.0, [k](std::size_t m, const Vec3& x) {
    const double wave = static_cast<double>(m + 1) * k;
    return Vec3{std::cos(wave * x[0]), 0.0, 0.0};
  });
  EXPECT_THROW((void)calc_edited(bank, {.cuts = {{example::kCornerM, 0.05, 1e-4}}}), InputError);
  bank.sensitivities = calc_sensitivities(bank, make_elasticity(0.0), kDensity, 2, {});
  const Vec3 top = example::kCornerM + Vec3{0.15, 0.01, 0.01};
  const std::vector<Cut> cuts{{top, 0.05, 1e-4}};
  const std::vector<double> depth = calc_depth(bank, cuts);
  double volume_mm3 = 0.0;
  for (std::size_t site = 0; site < depth.size(); ++site) {
    const bool is_top = bank.sensitivities.normal[site][2] > 0.9F;
    EXPECT_TRUE(depth[site] == 0.0 || is_top);
    EXPECT_LE(depth[site], 0.1 + 1e-12);
    volume_mm3 += 1e6 * bank.sensitivities.area_m2[site] * depth[site];
  }
  EXPECT_GT(volume_mm3, 50.0);  // of the 20 mm of its width: 20 mm times 0.1 mm times 16/15 of the radius
  EXPECT_LT(volume_mm3, 107.0);
  const Bank cut = calc_edited(bank, {.cuts = cuts});
  // In the middle cos(k x) = 0 of mode 1: only strain, less material lowers it; of mode 2 only motion: it rises.
  EXPECT_LT(cut.freq_hz(0), bank.freq_hz(0));
  EXPECT_GT(cut.freq_hz(1), bank.freq_hz(1));
  const std::vector<double> cents = calc_changes(bank, depth);
  for (std::size_t m = 0; m < 2; ++m) EXPECT_NEAR(1200.0 * std::log2(cut.freq_hz(m) / bank.freq_hz(m)), cents[m], 1e-6);
  const std::vector<float> corners = calc_corner_density(bank, 0);
  ASSERT_EQ(corners.size(), 3 * bank.triangles.size());
  EXPECT_EQ(find_faults(cut), std::vector<std::string>());
}

TEST(Sensitivities, ThatDisagreeAreRefused) {
  Bank good = example::make_bank(4, 6);
  good.sensitivities = calc_sensitivities(good, make_elasticity(0.3), kDensity, 4, {});
  const auto find = [&](const std::function<void(Sensitivities&)>& spoil) {
    Bank bad = good;
    spoil(bad.sensitivities);
    const std::vector<std::string> faults = find_faults(bad);
    return faults.empty() ? "" : faults[0];
  };
  EXPECT_EQ(find([](Sensitivities&) {}), "");
  EXPECT_NE(find([](Sensitivities& s) { s.vertex[3] = 100000; }).find("sensitivity/vertex"), std::string::npos);
  EXPECT_NE(find([](Sensitivities& s) { s.vertex[3] = -1; }).find("sensitivity/vertex"), std::string::npos);
  EXPECT_NE(find([](Sensitivities& s) { s.modes[1] = {2, 2}; }).find("sensitivity/modes"), std::string::npos);
  EXPECT_NE(find([](Sensitivities& s) { s.scale[0] = std::nan(""); }).find("sensitivity/scale"), std::string::npos);
  EXPECT_NE(find([](Sensitivities& s) { s.area_m2[0] = -1.0F; }).find("area_m2"), std::string::npos);
  EXPECT_NE(find([](Sensitivities& s) { s.density.pop_back(); }).find("disagree"), std::string::npos);
  EXPECT_NE(find([](Sensitivities& s) { s.own_error_cents = {1.0}; }).find("own_error_cents"), std::string::npos);
  EXPECT_NE(find([](Sensitivities& s) { s.count = 7; }).find("lowest modes"), std::string::npos);
  for (const char* name : {"sensitivity/density", "sensitivity/vertex", "sensitivity/by_parameter", "sensitivity/modes"}) {
    Arrays arrays{good};
    arrays.find(name).field.shape[0] += 1;
    EXPECT_NE(arrays.find_error(), "") << name;
  }
}

}  // namespace
}  // namespace carillon::bank
