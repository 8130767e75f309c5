// Materials, damping laws and bodies in jobs: reading, refusals, and round trips.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <string>

#include "precompute/job/job_spec.hpp"
#include "tests/unit/precompute/job/bad_job.hpp"

namespace {

using carillon::InputError;
using carillon::material::calc_eigenvalues, carillon::material::calc_mean_shear_pa;
using carillon::tests::BadJob;
using namespace carillon::job;

std::string job_with(const std::string& rest) { return "{\"mesh\": \"m.msh\", \"bank\": \"out/b.bank\",\n" + rest + "}"; }
std::string steel(const std::string& damping) {
  return "{\"young_modulus_pa\": 2e11, \"poisson_ratio\": 0.3, \"density_kg_m3\": 7850, \"damping\": " + damping + "}";
}
const std::string kRayleigh = R"({"rayleigh": {"alpha1_s": 1e-7, "alpha2_per_s": 0.5}})";
std::string with_damping(const std::string& damping) { return job_with("\"material\": " + steel(damping)); }
std::string wood(const std::string& inside) {
  return job_with("\"material\": {\"density_kg_m3\": 400, \"damping\": {\"internal_friction\": {\"tan_phi\": 0.01}},\n\"orthotropic\": {" +
                  inside + "}}");
}
const std::string kSpruce =
    R"("young_modulus_pa": [11e9, 0.9e9, 0.5e9], "shear_modulus_pa": [0.7e9, 0.04e9, 0.6e9], "poisson_ratio": [0.37, 0.43, 0.47])";
const std::string kBody = R"("bank": "b", "material": )" + steel(kRayleigh);

double lambda_at(double freq_hz) { return std::pow(2 * std::numbers::pi * freq_hz, 2); }

TEST(DampingLaws, give_the_decay_of_their_formulas) {
  const auto decay = [](const std::string& damping, double f) {
    return parse_job(with_damping(damping), "/j.json").material.calc_decay_per_s(lambda_at(f));
  };
  const double omega = 2 * std::numbers::pi * 1000;
  EXPECT_NEAR(decay(kRayleigh, 1000), (1e-7 * omega * omega + 0.5) / 2, 1e-12);
  EXPECT_NEAR(decay(R"({"internal_friction": {"tan_phi": 0.01}})", 1000), omega * 0.005, 1e-12);
  EXPECT_NEAR(decay(R"({"caughey": {"powers": [-1, 0, 2], "coefficients": [3e7, 2, 1e-16]}})", 1000),
              (3e7 / (omega * omega) + 2 + 1e-16 * std::pow(omega, 4)) / 2, 1e-9);
  EXPECT_NEAR(decay(R"({"caughey": {"coefficients": [0.5, 1e-7]}})", 1000), decay(kRayleigh, 1000), 1e-12);
}

TEST(LossTables, are_linear_in_log_frequency_and_constant_beyond_their_ends) {
  const auto material = parse_job(with_damping(R"({"loss_table": [[100, 0.01], [1000, 0.03], [4000, 0.02]]})"), "/j.json").material;
  const auto eta = [&](double f) { return 2 * material.calc_decay_per_s(lambda_at(f)) / (2 * std::numbers::pi * f); };
  EXPECT_NEAR(eta(1000), 0.03, 1e-12);
  EXPECT_NEAR(eta(std::sqrt(100.0 * 1000)), 0.02, 1e-12);
  EXPECT_NEAR(eta(2000), 0.025, 1e-12);
  EXPECT_NEAR(eta(20), 0.01, 1e-12);
  EXPECT_NEAR(eta(19000), 0.02, 1e-12);
}

TEST(OrthotropicMaterials, have_an_isotropic_equivalent_by_Hills_average) {
  const auto material = parse_job(wood(kSpruce), "/j.json").material;
  // By numpy: Hill's mean of the isotropic parts of C and of its inverse, as fourth-order tensors.
  EXPECT_NEAR(material.young_modulus_pa / 1527605905.64, 1, 1e-11);
  EXPECT_NEAR(material.poisson_ratio, 0.264749891816, 1e-11);
}

TEST(OrthotropicMaterials, have_the_inverse_of_their_compliance) {
  const auto c = parse_job(wood(kSpruce + ", \"axes\": [[0, 1, 0], [0, 0, 1]]"), "/j.json").material.calc_elasticity_pa();
  // Axis 1 of the material is y of the mesh, 2 is z, 3 is x. A tension along y: strain S e_y gives the stress e_y.
  const double strain[3] = {-0.47 / 11e9, 1 / 11e9, -0.37 / 11e9};
  for (int i = 0; i < 3; ++i) {
    double stress = 0;
    for (int j = 0; j < 3; ++j) stress += c[6 * i + j] * strain[j];
    EXPECT_NEAR(stress, i == 1 ? 1 : 0, 1e-12) << i;
  }
  EXPECT_NEAR(c[6 * 3 + 3], 0.7e9, 1e-3);   // yz is 12
  EXPECT_NEAR(c[6 * 4 + 4], 0.04e9, 1e-3);  // xz is 32
  EXPECT_NEAR(c[6 * 5 + 5], 0.6e9, 1e-3);   // xy is 31
}

TEST(Elasticity, has_the_eigenvalues_of_an_isotropic_solid) {
  Material steel;
  steel.young_modulus_pa = 2e11;
  steel.poisson_ratio = 0.3;
  const auto values = calc_eigenvalues(steel.calc_elasticity_pa());
  for (int i = 0; i < 5; ++i) EXPECT_NEAR(values[i] / (2e11 / 1.3), 1, 1e-14) << i;  // 2 mu, five times
  EXPECT_NEAR(values[5] / (2e11 / 0.4), 1, 1e-14);                                   // 3 K
  EXPECT_NEAR(calc_mean_shear_pa(steel.calc_elasticity_pa()) / (2e11 / 2.6), 1, 1e-14);
}

TEST(Elasticity, has_the_same_eigenvalues_and_mean_shear_for_any_axes) {
  const auto straight = parse_job(wood(kSpruce), "/j.json").material.calc_elasticity_pa();
  const auto oblique = parse_job(wood(kSpruce + ", \"axes\": [[1, 2, 2], [2, 1, -2]]"), "/j.json").material.calc_elasticity_pa();
  const auto expected = calc_eigenvalues(straight), found = calc_eigenvalues(oblique);
  for (int i = 0; i < 6; ++i) EXPECT_NEAR(found[i] / expected[i], 1, 1e-12) << i;
  EXPECT_NEAR(calc_mean_shear_pa(oblique) / calc_mean_shear_pa(straight), 1, 1e-13);
}

class RoundTrip : public testing::TestWithParam<std::pair<const char*, std::string>> {};
TEST_P(RoundTrip, of_a_job_resolves_to_itself) {
  const JobSpec job = parse_job(GetParam().second, "/jobs/a/job.json");
  const std::string text = resolved_json(job, "/jobs/a/out", "");
  const JobSpec again = parse_job(text, "/jobs/a/out/x.json");
  EXPECT_EQ(resolved_json(again, "/jobs/a/out", ""), text);
  const double lambda = lambda_at(440);
  EXPECT_EQ(again.material.calc_decay_per_s(lambda), job.material.calc_decay_per_s(lambda));
  EXPECT_EQ(again.material.calc_elasticity_pa(), job.material.calc_elasticity_pa());
  EXPECT_EQ(again.materials.size(), job.materials.size());
  EXPECT_EQ(again.fixed.size(), job.fixed.size());
  EXPECT_EQ(again.accuracy_cents, job.accuracy_cents);
  EXPECT_EQ(again.method, job.method);
  EXPECT_EQ(again.body.has_value(), job.body.has_value());
  if (job.body) {
    EXPECT_EQ(again.body->dimensions, job.body->dimensions);
    EXPECT_EQ(again.body->surface, job.body->surface);
    EXPECT_EQ(again.body->nodes, job.body->nodes);
    EXPECT_EQ(again.body->edge_m, job.body->edge_m);
    EXPECT_EQ(again.body->height_m, job.body->height_m);
  }
}
INSTANTIATE_TEST_SUITE_P(
    Jobs, RoundTrip,
    testing::Values(
        std::pair{"wood", wood(kSpruce)}, std::pair{"turned_wood", wood(kSpruce + ", \"axes\": [[1, 2, 3], [3, 0, -1], [-2, 10, -6]]")},
        std::pair{"caughey", with_damping(R"({"caughey": {"powers": [-1, 0.5], "coefficients": [3e7, 1e-3]}})")},
        std::pair{"table", with_damping(R"({"loss_table": [[100, 0.01], [1000, 0.03]]})")},
        std::pair{"regions", job_with("\"materials\": {\"1\": " + steel(kRayleigh) + ", \"top plate\": " + steel(kRayleigh) + "}")},
        std::pair{"default_and_region",
                  job_with("\"material\": " + steel(kRayleigh) + ", \"materials\": {\"3\": " + steel(kRayleigh) + "}")},
        std::pair{"fixed_list", job_with("\"material\": " + steel(kRayleigh) +
                                         R"(, "fixed": ["x-min", {"box_m": {"min": [0, 0, 0], "max": [1, 1, 1]}}, {"node_set": "y"}],
                                                         "solver": {"method": "krylov-schur", "factorisation": "ldlt"})")},
        std::pair{"accuracy", job_with("\"material\": " + steel(kRayleigh) + ", \"accuracy_cents\": 5")},
        std::pair{"tube",
                  "{\"body\": {\"shape\": \"tube\", \"length_m\": 0.505, \"outer_radius_m\": 0.0125, \"wall_m\": 0.001, \"nodes\": 6000}," +
                      kBody + "}"},
        std::pair{"bowl", "{\"body\": {\"shape\": \"bowl\", \"opening_angle_deg\": 120}, \"accuracy_cents\": 3," + kBody + "}"},
        std::pair{"bunny",
                  "{\"body\": {\"surface\": \"bunny.obj\", \"height_m\": 0.13, \"wall_m\": 0.005, \"edge_m\": 0.003}," + kBody + "}"}),
    [](const auto& info) { return std::string(info.param.first); });

class BadMaterials : public testing::TestWithParam<BadJob> {};
TEST_P(BadMaterials, are_refused_with_line_and_remedy) { carillon::tests::expect_refused(GetParam()); }

std::string wood_of(const std::string& nu) {
  return wood("\"young_modulus_pa\": [11e9, 0.9e9, 0.5e9], \"shear_modulus_pa\": [0.7e9, 0.04e9, 0.6e9],\n\"poisson_ratio\": " + nu);
}
std::string with_material(const std::string& rest) { return job_with("\"material\": " + steel(kRayleigh) + ",\n" + rest); }
std::string with_body(const std::string& body, const std::string& rest = "") { return "{" + kBody + rest + ",\n\"body\": {" + body + "}}"; }

INSTANTIATE_TEST_SUITE_P(
    Table, BadMaterials,
    testing::Values(
        BadJob{"two_laws", with_damping("{\"rayleigh\": {},\n\"internal_friction\": {\"tan_phi\": 0.1}}"),
               "job.json:3:", "one damping law"},
        BadJob{"no_tan", with_damping("{\"internal_friction\": {}}"), "job.json:2:", "\"tan_phi\" is missing"},
        BadJob{"negative_tan", with_damping("{\"internal_friction\": {\"tan_phi\": -1}}"), "job.json:2:", "not be negative"},
        BadJob{"tan_beyond_physics", with_damping("{\"internal_friction\": {\"tan_phi\": 2}}"),
               "job.json:2: \"material.damping.internal_friction.tan_phi\"", "must be below 2"},
        BadJob{"loss_beyond_physics", with_damping("{\"loss_table\": [[100, 0.1],\n[200, 5]]}"),
               "job.json:", "at 200 Hz must not be negative and must be below 2"},
        BadJob{"negative_series", with_damping("{\"caughey\": {\"powers\": [0, 0.5, 1], \"coefficients\": [1e4, -1, 1e-5]}}"),
               "job.json:2: \"material.damping.caughey\"", "negative on the band"},
        BadJob{"powers_short", with_damping("{\"caughey\": {\"powers\": [0],\n\"coefficients\": [1, 2]}}"),
               "job.json:2:", "one entry a coefficient"},
        BadJob{"table_descends", with_damping("{\"loss_table\": [[200, 0.1], [100, 0.1]]}"), "job.json:2:", "must ascend"},
        BadJob{"table_flat", with_damping("{\"loss_table\": [200, 0.1]}"), "job.json:2:", "a list of 2 numbers"},
        BadJob{"table_negative", with_damping("{\"loss_table\": [[200, -0.1]]}"), "job.json:2:", "loss factor at 200 Hz"},
        BadJob{"not_definite_by_one", wood_of("[4, 0.43, 0.47]"), "job.json:4:", "nu12 is 4 and has to lie within"},
        BadJob{"not_definite_by_all", wood_of("[2, 0.9, 3]"), "job.json:4:", "least eigenvalue of the compliance"},
        BadJob{"skew_axes", wood(kSpruce + ",\n\"axes\": [[1, 0, 0], [1, 1, 0]]"), "job.json:4:", "meet at 45.0 degrees"},
        BadJob{"one_axis", wood(kSpruce + ",\n\"axes\": [[1, 0, 0]]"), "job.json:4:", "two directions"},
        BadJob{"axis_without_length", wood(kSpruce + ",\n\"axes\": [[1, 0, 0], [0, 0, 0]]"), "job.json:4:", "no length"},
        BadJob{"both_elasticities",
               job_with("\"material\": {\"density_kg_m3\": 1, \"damping\": {\"rayleigh\": {}}, \"orthotropic\": {" + kSpruce +
                        "},\n\"poisson_ratio\": 0.3}"),
               "job.json:3:", "\"orthotropic\" holds the elasticity"},
        BadJob{"no_regions", job_with("\"materials\": {}"), "job.json:2:", "one material for each region"},
        BadJob{"bad_region", job_with("\"materials\": {\"1\": {\n\"density\": 1}}"), "job.json:2:", "is missing"},
        BadJob{"method", with_material("\"solver\": {\"method\": \"lanczos\"}"), "job.json:3:", "\"block-lanczos\""},
        BadJob{"accuracy_and_element", with_material("\"accuracy_cents\": 5,\n\"element\": \"T4\""), "job.json:4: \"element\"",
               "chooses the element"},
        BadJob{"accuracy_and_tolerance", with_material("\"accuracy_cents\": 5,\n\"solver\": {\"tolerance\": 1e-9}"),
               "job.json:4:", "chooses the tolerance"},
        BadJob{"accuracy_and_nodes", with_body("\"shape\": \"tube\", \"nodes\": 5000", ", \"accuracy_cents\": 5"),
               "job.json:2:", "chooses the mesh"},
        BadJob{"accuracy_zero", with_material("\"accuracy_cents\": 0"), "job.json:3:", "from 0.001 to 1200 cents"},
        BadJob{"body_and_mesh", "{\"mesh\": \"m\"," + kBody + ",\n\"body\": {\"shape\": \"tube\"}}", "job.json:2: \"body\"", "give one of"},
        BadJob{"shape_mistyped", with_body("\"shape\": \"tub\""), "job.json:2:", "did you mean \"tube\"?"},
        BadJob{"dimension_of_another", with_body("\"shape\": \"tube\", \"radius_m\": 1"),
               "job.json:2:", "did you mean \"outer_radius_m\"?"},
        BadJob{"length_in_mm", with_body("\"shape\": \"tube\", \"length_m\": 50500"), "job.json:2:", "from 1e-06 to 10000 m"},
        BadJob{"shape_and_surface", with_body("\"shape\": \"tube\", \"surface\": \"a.obj\""), "job.json:2:", "one of the two"},
        BadJob{"nodes_and_edge", with_body("\"surface\": \"a.obj\", \"nodes\": 5000, \"edge_m\": 0.1"),
               "job.json:2:", "give one of the two"},
        BadJob{"bank_is_surface", "{\"bank\": \"a.obj\", \"material\": " + steel(kRayleigh) + ", \"body\": {\"surface\": \"a.obj\"}}",
               "job.json:1:", "overwrite the surface"},
        BadJob{"fixed_number", with_material("\"fixed\": [3]"), "job.json:3:", "a text or an object"}),
    [](const auto& info) { return info.param.name; });

}  // namespace
