// Materials by region, orthotropic elasticity and decay from energy shares, against closed forms, on 1, 2 and 3 ranks.
#include "precompute/fem/materials.hpp"

#include <fmt/core.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "precompute/fem/assemble.hpp"
#include "precompute/fem/element.hpp"
#include "precompute/fem/energy.hpp"
#include "precompute/mesh/distributed/distribute.hpp"
#include "precompute/petsc/session.hpp"
#include "tests/support/box_mesh.hpp"
#include "tests/support/catch_message.hpp"
#include "tests/support/ranks.hpp"

namespace carillon::fem {
namespace {

using testing::HasSubstr;
using tests::get_rank;
using tests::get_ranks;

const MPI_Comm kWorld = MPI_COMM_WORLD;
constexpr std::array<double, 3> kSize{0.4, 0.2, 0.1};

/// Region 7 is the half of smaller x, region 9 the other.
mesh::TetMesh make_halves(int order) {
  mesh::TetMesh box = tests::make_box({6, 3, 2}, kSize, order);
  for (std::int64_t e = 0; e < box.tet_count(); ++e) {
    double x = 0;
    for (int i = 0; i < 4; ++i) x += box.nodes_m[box.tet(e)[i]][0] / 4;
    box.regions.resize(box.tet_count());
    box.regions[e] = x < kSize[0] / 2 ? 7 : 9;
  }
  return box;
}

mesh::DistributedMesh distribute_halves(int order) {
  const auto whole = make_halves(order);
  return mesh::distribute(kWorld, get_rank() == 0 ? whole : mesh::TetMesh{}, {});
}

job::JobSpec parse(const std::string& materials) {
  return job::parse_job("{\"mesh\": \"m\", \"bank\": \"b\",\n" + materials + "}", "/jobs/job.json");
}

std::string isotropic(double density, const std::string& damping = R"({"rayleigh": {}})") {
  return fmt::format(R"({{"young_modulus_pa": 1e9, "poisson_ratio": 0.25, "density_kg_m3": {}, "damping": {}}})", density, damping);
}

TEST(MaterialsByRegion, are_found_by_tag_and_by_name_and_fill_the_rest_with_the_default) {
  const mesh::DistributedMesh pieces = distribute_halves(1);
  for (const std::string key : {"9", "oak"}) {
    const auto job = parse("\"material\": " + isotropic(1000) + ",\n\"materials\": {\"" + key + "\": " + isotropic(3000) + "}");
    const Materials materials = find_materials(kWorld, pieces.local, job, {{9, "oak"}});
    ASSERT_EQ(materials.list.size(), 2u);
    const auto volume = calc_volumes(kWorld, pieces.local, materials);
    EXPECT_NEAR(volume[0], 0.004, 1e-15);
    EXPECT_NEAR(volume[1], 0.004, 1e-15);
    const RigidBody body = calc_rigid_body(kWorld, pieces.local, materials);
    EXPECT_NEAR(body.mass_kg, 0.004 * 4000, 1e-12);
    EXPECT_NEAR(body.centre_m[0], (1000 * 0.1 + 3000 * 0.3) / 4000, 1e-14);
  }
}

TEST(MaterialsByRegion, are_found_among_names_of_any_bytes) {
  const mesh::DistributedMesh pieces = distribute_halves(1);
  const auto job = parse("\"material\": " + isotropic(1000) + ",\n\"materials\": {\"12 oak\": " + isotropic(3000) + "}");
  const std::map<std::int32_t, std::string> names{{-3, ""}, {7, std::string("7\0 a\n", 5)}, {9, "12 oak"}};
  const Materials materials = find_materials(kWorld, pieces.local, job, get_rank() == 0 ? names : std::map<std::int32_t, std::string>{});
  ASSERT_EQ(materials.region, (std::vector<std::string>{"12 oak", ""}));
  EXPECT_NEAR(calc_rigid_body(kWorld, pieces.local, materials).mass_kg, 0.004 * 4000, 1e-12);
}

void expect_refused(const std::string& materials, const std::string& words) {
  const mesh::DistributedMesh pieces = distribute_halves(1);
  tests::expect_error<InputError>({words, "job.json", "9 \"oak\""}, [&] {
    find_materials(kWorld, pieces.local, parse(materials), {{9, "oak"}});
  });
}

TEST(MaterialsByRegion, that_miss_a_region_are_refused_and_the_region_is_named) {
  expect_refused("\"materials\": {\"7\": " + isotropic(1) + "}", "no material for region 9 \"oak\"");
}

TEST(MaterialsByRegion, that_name_a_region_which_the_mesh_has_not_are_refused_with_the_line_and_the_regions_there_are) {
  expect_refused("\"material\": " + isotropic(1) + ",\n\n\"materials\": {\"8\": " + isotropic(1) + "}", "job.json:4: \"materials.8\"");
  expect_refused("\"material\": " + isotropic(1) + ",\n\n\"materials\": {\"8\": " + isotropic(1) + "}", "which has 7, 9 \"oak\"");
}

TEST(MaterialsByRegion, that_name_a_region_twice_are_refused) {
  expect_refused("\"material\": " + isotropic(1) + ",\n\"materials\": {\"9\": " + isotropic(1) + ", \"oak\": " + isotropic(2) + "}",
                 "already has a material");
}

TEST(MaterialsByRegion, fail_on_every_rank_with_the_words_of_the_one_that_lacks_tags) {
  mesh::DistributedMesh pieces = distribute_halves(1);
  const auto job = parse("\"materials\": {\"7\": " + isotropic(1) + ", \"9\": " + isotropic(1) + "}");
  if (get_rank() == get_ranks() - 1) pieces.local.region.resize(1);
  tests::expect_error<SystemError>({"with 1 region tags"}, [&] { find_materials(kWorld, pieces.local, job); });
  MPI_Barrier(kWorld);  // no rank is left waiting in another collective
}

/// Fills a (3n, fields) dense matrix with fields of the positions.
petsc::MatHandle sample(const mesh::LocalMesh& local, const std::vector<std::function<Vec3(const Vec3&)>>& fields) {
  petsc::MatHandle shapes;
  const auto count = static_cast<PetscInt>(fields.size());
  petsc::check(MatCreateDense(kWorld, 3 * local.free_nodes, PETSC_DECIDE, PETSC_DETERMINE, count, nullptr, shapes.out()));
  double* values = nullptr;
  PetscInt stride = 0;
  petsc::check(MatDenseGetLDA(shapes, &stride));
  petsc::check(MatDenseGetArray(shapes, &values));
  for (PetscInt j = 0; j < count; ++j)
    for (int i = 0; i < local.free_nodes; ++i) {
      const Vec3 u = fields[j](local.nodes_m[i]);
      for (int d = 0; d < 3; ++d) values[j * stride + 3 * i + d] = u[d];
    }
  petsc::check(MatDenseRestoreArray(shapes, &values));
  petsc::check(MatAssemblyBegin(shapes, MAT_FINAL_ASSEMBLY));
  petsc::check(MatAssemblyEnd(shapes, MAT_FINAL_ASSEMBLY));
  return shapes;
}

TEST(DecayOfACompositeBar, follows_from_the_shares_of_energy_of_each_half) {
  // u_x = x: uniform strain, so the elastic shares follow the moduli, 1 : 3; the kinetic ones are 1000 integral_0^.2 x^2 : 3000
  // integral_.2^.4 x^2 = 1 : 21. u_x = x^2: elastic 1 : 3 * 7.
  const std::string soft = R"({"young_modulus_pa": 1e9, "poisson_ratio": 0.25, "density_kg_m3": 1000,
                               "damping": {"rayleigh": {"alpha1_s": 1e-6, "alpha2_per_s": 40}}})";
  const std::string stiff = R"({"young_modulus_pa": 3e9, "poisson_ratio": 0.25, "density_kg_m3": 3000,
                                "damping": {"internal_friction": {"tan_phi": 0.02}}})";
  const auto job = parse("\"materials\": {\"7\": " + soft + ",\n\"9\": " + stiff + "}");
  const mesh::DistributedMesh pieces = distribute_halves(2);
  const Materials materials = find_materials(kWorld, pieces.local, job);
  const auto shapes = sample(pieces.local, {[](const Vec3& x) {
                                              return Vec3{x[0], 0, 0};
                                            },
                                            [](const Vec3& x) {
                                              return Vec3{x[0] * x[0], 0, 0};
                                            }});
  const std::vector<double> lambda{1e6, 4e8};
  const Decay decay = calc_decay(kWorld, pieces.local, materials, job::Mass::consistent, lambda, shapes);
  ASSERT_EQ(decay.shares.elastic.size(), 4u);
  EXPECT_NEAR(decay.shares.elastic[0], 1.0 / 4, 1e-12);
  EXPECT_NEAR(decay.shares.elastic[1], 3.0 / 4, 1e-12);
  EXPECT_NEAR(decay.shares.elastic[2], 1.0 / 22, 1e-12);
  EXPECT_NEAR(decay.shares.kinetic[0], 1.0 / 22, 1e-12);
  EXPECT_NEAR(decay.shares.kinetic[1], 21.0 / 22, 1e-12);
  for (int j = 0; j < 2; ++j) EXPECT_NEAR(decay.shares.elastic[2 * j] + decay.shares.elastic[2 * j + 1], 1, 1e-14);
  EXPECT_NEAR(decay.decay_per_s[0], (1e-6 * 1e6 / 4 + 40.0 / 22 + 0.02 * 1e3 * 3 / 4) / 2, 1e-9);
}

TEST(DecayOfOneMaterial, is_its_law_and_of_two_alike_halves_the_same) {
  const std::string law = R"({"caughey": {"powers": [0, 0.5, 1], "coefficients": [12, 0.001, 2e-7]}})";
  const mesh::DistributedMesh pieces = distribute_halves(1);
  const std::vector<double> lambda{1e6, 1e9};
  const auto shapes = sample(pieces.local, {[](const Vec3& x) {
                                              return Vec3{x[0], 0, 0};
                                            },
                                            [](const Vec3& x) {
                                              return Vec3{0, x[0] * x[2], 0};
                                            }});
  const auto whole = parse("\"material\": " + isotropic(1000, law));
  const Decay one = calc_decay(kWorld, pieces.local, find_materials(kWorld, pieces.local, whole), job::Mass::consistent, lambda, shapes);
  EXPECT_NEAR(one.decay_per_s[0], (12 + 0.001 * 1e3 + 2e-7 * 1e6) / 2, 1e-12);
  const auto halves = parse("\"materials\": {\"7\": " + isotropic(1000, law) + ", \"9\": " + isotropic(1000, law) + "}");
  const Decay two = calc_decay(kWorld, pieces.local, find_materials(kWorld, pieces.local, halves), job::Mass::consistent, lambda, shapes);
  for (int j = 0; j < 2; ++j) EXPECT_NEAR(two.decay_per_s[j] / one.decay_per_s[j], 1, 1e-12);
}

// Spruce, nearly: along the grain, radial, tangential.
const std::string kSpruce = R"({"orthotropic": {"young_modulus_pa": [11e9, 0.9e9, 0.5e9], "shear_modulus_pa": [0.7e9, 0.04e9, 0.6e9],
                                "poisson_ratio": [0.37, 0.43, 0.47]AXES}, "density_kg_m3": 400, "damping": {"rayleigh": {}}})";

material::Material make_spruce(const std::string& axes) {
  std::string text = kSpruce;
  text.replace(text.find("AXES"), 4, axes);
  return parse("\"material\": " + text).material;
}

double calc_energy(const Materials& materials, const mesh::LocalMesh& local, const std::function<Vec3(const Vec3&)>& field) {
  const System system = assemble(kWorld, local, materials, job::Mass::consistent);
  const auto shapes = sample(local, {field});
  petsc::VecHandle x, y;
  petsc::check(MatCreateVecs(system.stiffness, x.out(), y.out()));
  petsc::check(MatGetColumnVector(shapes, x, 0));
  petsc::check(MatMult(system.stiffness, x, y));
  double energy = 0;
  petsc::check(VecDot(x, y, &energy));
  return energy;
}

TEST(OrthotropicBox, pulled_along_an_axis_stores_the_energy_of_Youngs_modulus_and_sheared_that_of_G) {
  // Strains of the compliance's own columns: eps = S e_i, so eps^T C eps = S_ii = 1 / E_i or 1 / G.
  const double volume = kSize[0] * kSize[1] * kSize[2];
  for (const int order : {1, 2}) {
    const mesh::DistributedMesh pieces = distribute_halves(order);
    const Materials spruce = make_spruce("");
    const double e[3] = {11e9, 0.9e9, 0.5e9}, nu12 = 0.37, nu23 = 0.43, nu13 = 0.47;
    const double s[3][3] = {
        {1 / e[0], -nu12 / e[0], -nu13 / e[0]}, {-nu12 / e[0], 1 / e[1], -nu23 / e[1]}, {-nu13 / e[0], -nu23 / e[1], 1 / e[2]}};
    for (int i = 0; i < 3; ++i) {
      const double energy = calc_energy(spruce, pieces.local, [&](const Vec3& x) {
        return Vec3{s[i][0] * x[0], s[i][1] * x[1], s[i][2] * x[2]};
      });
      EXPECT_NEAR(energy, volume / e[i], 1e-11 * volume / e[i]) << i;
    }
    const double g12 = 0.7e9, g23 = 0.04e9, g13 = 0.6e9;
    EXPECT_NEAR(calc_energy(spruce, pieces.local, [&](const Vec3& x) { return Vec3{x[1], 0, 0}; }), volume * g12, 1e-11 * volume * g12);
    EXPECT_NEAR(calc_energy(spruce, pieces.local, [&](const Vec3& x) { return Vec3{0, x[2], 0}; }), volume * g23, 1e-11 * volume * g23);
    EXPECT_NEAR(calc_energy(spruce, pieces.local, [&](const Vec3& x) { return Vec3{0, 0, x[0]}; }), volume * g13, 1e-11 * volume * g13);
  }
}

TEST(OrthotropicBox, turned_together_with_its_axes_keeps_its_energy) {
  // A rotation with rows r: the material's axes become r e_1, r e_2, and the field u(x) becomes r u(r^T x).
  const double a = 0.7, b = 0.4, ca = std::cos(a), sa = std::sin(a), cb = std::cos(b), sb = std::sin(b);
  const double r[3][3] = {{ca, -sa * cb, sa * sb}, {sa, ca * cb, -ca * sb}, {0, sb, cb}};
  const auto turn = [&](const Vec3& x) {
    Vec3 y{};
    for (int i = 0; i < 3; ++i)
      for (int k = 0; k < 3; ++k) y[i] += r[i][k] * x[k];
    return y;
  };
  const auto turn_back = [&](const Vec3& x) {
    Vec3 y{};
    for (int i = 0; i < 3; ++i)
      for (int k = 0; k < 3; ++k) y[i] += r[k][i] * x[k];
    return y;
  };
  mesh::TetMesh turned = make_halves(2);
  for (Vec3& x : turned.nodes_m) x = turn(x);
  const auto field = [](const Vec3& x) { return Vec3{x[0] * x[1], x[2] * x[2] - x[0], 3 * x[1] * x[2]}; };
  const double straight = calc_energy(make_spruce(""), distribute_halves(2).local, field);
  const std::string axes = fmt::format(R"(, "axes": [[{:.17g}, {:.17g}, {:.17g}], [{:.17g}, {:.17g}, {:.17g}]])", r[0][0], r[1][0], r[2][0],
                                       r[0][1], r[1][1], r[2][1]);
  const mesh::DistributedMesh pieces = mesh::distribute(kWorld, get_rank() == 0 ? turned : mesh::TetMesh{}, {});
  const double oblique = calc_energy(make_spruce(axes), pieces.local, [&](const Vec3& x) { return turn(field(turn_back(x))); });
  EXPECT_NEAR(oblique / straight, 1, 1e-11);
}

class IsotropicConstants : public testing::TestWithParam<double> {};

TEST_P(IsotropicConstants, given_as_orthotropic_ones_make_the_same_stiffness) {
  const double e = 70e9, nu = GetParam(), g = e / (2 * (1 + nu));
  const std::string text = fmt::format(
      R"({{"orthotropic": {{"young_modulus_pa": [{0}, {0}, {0}], "shear_modulus_pa": [{1:.17g}, {1:.17g}, {1:.17g}], "poisson_ratio": [{2}, {2}, {2}],
           "axes": [[1, 2, 2], [2, 1, -2]]}}, "density_kg_m3": 1, "damping": {{"rayleigh": {{}}}}}})",
      e, g, nu);
  const material::Material as_orthotropic = parse("\"material\": " + text).material;
  material::Material as_isotropic;
  as_isotropic.young_modulus_pa = e;
  as_isotropic.poisson_ratio = nu;
  as_isotropic.density_kg_m3 = 1;
  const double stiffest = as_isotropic.lame_lambda_pa() + 2 * as_isotropic.lame_mu_pa();
  EXPECT_NEAR(as_orthotropic.young_modulus_pa / e, 1, 1e-14 * stiffest / e);
  const std::vector<Vec3> curved{{0, 0, 0},      {1, 0.1, 0},      {0.2, 1, 0},    {0, 0.3, 1},     {0.5, 0.05, 0.1},
                                 {0.6, 0.55, 0}, {0.1, 0.5, -0.1}, {0, 0.15, 0.5}, {0.5, 0.2, 0.5}, {0.1, 0.65, 0.5}};
  std::vector<Vec3> straight = curved;
  for (int k = 0; k < 6; ++k)
    for (int d = 0; d < 3; ++d) straight[4 + k][d] = (curved[mesh::kEdges[k][0]][d] + curved[mesh::kEdges[k][1]][d]) / 2;
  for (const std::vector<Vec3>& x : {curved, straight, std::vector<Vec3>(curved.begin(), curved.begin() + 4)}) {
    ElementMatrices a, b;
    ASSERT_TRUE(calc_element(x, as_orthotropic, job::Mass::consistent, a));
    ASSERT_TRUE(calc_element(x, as_isotropic, job::Mass::consistent, b));
    // The inverse of the compliance loses digits by the ratio of the stiffest to the softest strain.
    for (std::size_t i = 0; i < a.stiffness.size(); ++i)
      EXPECT_NEAR(a.stiffness[i], b.stiffness[i], 1e-14 * stiffest * stiffest / e) << x.size() << " nodes, nu " << nu;
  }
}

INSTANTIATE_TEST_SUITE_P(PoissonsRatio, IsotropicConstants, testing::Values(0.0, 0.33, 0.45, 0.46, 0.49, 0.4999));

// Mean dilatation leaves uniform strains unchanged, in T4 and T10, for any anisotropy. Reference: the elasticity matrix.
TEST(OrthotropicRubber, keeps_the_energy_of_every_uniform_strain) {
  const std::string rubber =
      R"("material": {"orthotropic": {"young_modulus_pa": [3e6, 2e6, 1.5e6], "shear_modulus_pa": [0.9e6, 0.5e6, 0.7e6],
    "poisson_ratio": [0.24995, 0.83316, 0.74985]}, "density_kg_m3": 1100, "damping": {"rayleigh": {}}})";
  const material::Material material = parse(rubber).material;
  const material::Elasticity c = material.calc_elasticity_pa();
  EXPECT_GT(Solid(material).mean_dilatation_modulus_pa, 0.9 * c[1]);
  const std::array<double, 6> strain{0.3, -0.2, 0.15, 0.1, -0.25, 0.2};  // Voigt
  const auto field = [&](const Vec3& x) {
    return Vec3{strain[0] * x[0] + strain[5] * x[1] / 2 + strain[4] * x[2] / 2,
                strain[5] * x[0] / 2 + strain[1] * x[1] + strain[3] * x[2] / 2,
                strain[4] * x[0] / 2 + strain[3] * x[1] / 2 + strain[2] * x[2]};
  };
  double density = 0;  // twice the energy's, as calc_energy has it
  for (int i = 0; i < 6; ++i)
    for (int j = 0; j < 6; ++j) density += strain[i] * c[6 * i + j] * strain[j];
  for (const int order : {1, 2}) {
    const mesh::DistributedMesh pieces = distribute_halves(order);
    EXPECT_NEAR(calc_energy(material, pieces.local, field) / (0.008 * density), 1, 1e-9) << order;
  }
}

}  // namespace
}  // namespace carillon::fem
