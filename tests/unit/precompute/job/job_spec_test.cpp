#include "precompute/job/job_spec.hpp"

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "precompute/job/preview.hpp"
#include "runtime/base/failure.hpp"
#include "tests/support/folder.hpp"
#include "tests/unit/precompute/job/bad_job.hpp"

namespace {

using carillon::InputError;
using carillon::tests::BadJob;
using namespace carillon::job;

// OSG02 Table 1, ceramic bunny.
const std::string kMaterial =
    R"("material": {"lame_lambda_pa": 3.99e9, "lame_mu_pa": 2.05e9, "density_kg_m3": 2700, "damping": {"rayleigh": {"alpha1_s": 1e-6, "alpha2_per_s": 10}}})";
std::string job_with(const std::string& rest) { return "{\"mesh\": \"m.msh\", \"bank\": \"out/b.bank\",\n" + kMaterial + rest + "}"; }

TEST(JobSpec, defaults_are_T10_consistent_20_Hz_to_20_kHz) {
  const JobSpec job = parse_job(job_with(""), "/jobs/job.json");
  EXPECT_EQ(job.element, Element::T10);
  EXPECT_EQ(job.mass, Mass::consistent);
  EXPECT_EQ(job.band_hz, (std::array<double, 2>{20.0, 20000.0}));
  EXPECT_FALSE(job.max_modes);
  EXPECT_TRUE(job.fixed.empty());
  EXPECT_EQ(job.mesh, "/jobs/m.msh");
  EXPECT_EQ(job.bank, "/jobs/out/b.bank");
}

TEST(JobSpec, resources_are_read_and_not_in_the_resolved_job) {
  const JobSpec job = parse_job(job_with(R"(, "resources": {"ranks": 3, "memory_gb": 1.5, "time_limit_s": 60})"), "/jobs/job.json");
  EXPECT_EQ(job.resources.ranks, 3);
  EXPECT_EQ(job.resources.memory_gb, 1.5);
  EXPECT_EQ(job.resources.time_limit_s, 60.0);
  EXPECT_EQ(resolved_json(job, "/jobs", ""), resolved_json(parse_job(job_with(""), "/jobs/job.json"), "/jobs", ""));
  for (const char* bad : {"{\"ranks\": 0}", "{\"ranks\": 1.5}", "{\"memory_gb\": -1}", "{\"time_limit_s\": 0}", "{\"rank\": 1}", "7"})
    EXPECT_THROW(parse_job(job_with(std::string(", \"resources\": ") + bad), "/jobs/job.json"), InputError) << bad;
}

TEST(JobSpec, nonlinear_is_read_strictly_and_in_the_resolved_job) {
  EXPECT_FALSE(parse_job(job_with(""), "/jobs/job.json").nonlinear);
  const JobSpec plain = parse_job(job_with(R"(, "nonlinear": {})"), "/jobs/job.json");
  ASSERT_TRUE(plain.nonlinear);
  EXPECT_EQ(plain.nonlinear->modes, 50);
  EXPECT_EQ(plain.nonlinear->below_hz, 3000.0);
  EXPECT_EQ(plain.nonlinear->energy_error, 1e-2);
  const JobSpec job = parse_job(job_with(R"(, "nonlinear": {"modes": 30, "below_hz": 2000, "energy_error": 1e-3})"), "/jobs/job.json");
  EXPECT_EQ(job.nonlinear->modes, 30);
  EXPECT_EQ(job.nonlinear->below_hz, 2000.0);
  EXPECT_EQ(job.nonlinear->energy_error, 1e-3);
  const std::string text = resolved_json(job, "/jobs", "");
  EXPECT_EQ(resolved_json(parse_job(text, "/jobs/b.bank.resolved.json"), "/jobs", ""), text);
  EXPECT_EQ(parse_job(job_with(R"(, "max_modes": 20, "nonlinear": {})"), "/jobs/job.json").nonlinear->modes, 20);
  for (const char* bad :
       {"true", "\"stretch\"", "\"full\"", "{\"modes\": 0}", "{\"modes\": 401}", "{\"below_hz\": 10}", "{\"below_hz\": -1}",
        "{\"energy_error\": 0.5}", "{\"energy_error\": 0}", "{\"mode\": 3}", "{\"modes\": 30}, \"max_modes\": 20"})
    EXPECT_THROW(parse_job(job_with(std::string(", \"nonlinear\": ") + bad), "/jobs/job.json"), InputError) << bad;
  const char* known = R"({"body": {"membrane": {"shape": "circle", "radius_m": 0.2, "lowest_hz": 200, "density_kg_m2": 0.3}},
                          "bank": "b", "nonlinear": {}})";
  EXPECT_THROW(parse_job(known, "/jobs/job.json"), InputError);
  // Short and long form, for a held body.
  const JobSpec shortly = parse_job(job_with(R"(, "fixed": "rim", "nonlinear": "stretch")"), "/jobs/job.json");
  ASSERT_TRUE(shortly.nonlinear);
  EXPECT_TRUE(shortly.nonlinear->is_stretch);
  EXPECT_FALSE(job.nonlinear->is_stretch);
  const std::string long_form = R"(, "fixed": "rim", "nonlinear": {"form": "stretch", "modes": 50, "below_hz": 3000})";
  EXPECT_EQ(resolved_json(shortly, "/jobs", ""), resolved_json(parse_job(job_with(long_form), "/jobs/job.json"), "/jobs", ""));
  EXPECT_NE(resolved_json(shortly, "/jobs", "").find("\"stretch\""), std::string::npos);
  EXPECT_THROW(parse_job(job_with(R"(, "fixed": "rim", "nonlinear": {"form": "stretch", "energy_error": 1e-3})"), "/jobs/job.json"),
               InputError);
}

TEST(JobSpec, bank_is_optional_for_a_store_only) {
  const std::string text = "{\"mesh\": \"m.msh\", " + kMaterial + "}";
  EXPECT_TRUE(parse_job(text, "/jobs/job.json", BankKey::optional).bank.empty());
  EXPECT_EQ(resolved_json(parse_job(text, "/jobs/job.json", BankKey::optional), "/jobs", "").find("bank"), std::string::npos);
  EXPECT_THROW(parse_job(text, "/jobs/job.json"), InputError);
}

TEST(JobSpec, a_shape_has_a_short_form) {
  const auto read = [](const std::string& body) {
    return parse_job("{" + body + ", \"material\": \"glass\"}", "/jobs/job.json", BankKey::optional);
  };
  const JobSpec shortly = read(R"("shape": {"bowl": {"outer_radius_m": 0.06, "wall_m": 0.004, "nodes": 900}})");
  const JobSpec longly = read(R"("body": {"shape": "bowl", "outer_radius_m": 0.06, "wall_m": 0.004, "nodes": 900})");
  EXPECT_EQ(resolved_json(shortly, "/jobs", ""), resolved_json(longly, "/jobs", ""));
  for (const char* bad : {R"("shape": {})", R"("shape": {"bowl": {}, "bar": {}})", R"("shape": {"bol": {}})", R"("shape": "bowl")",
                          R"("shape": {"bowl": {}}, "mesh": "m.msh")", R"("shape": {"bowl": {"length_m": 1}})",
                          R"("shape": {"bowl": {"nodes": 900}}, "accuracy_cents": 5)"})
    EXPECT_THROW(read(bad), InputError) << bad;
}

TEST(JobSpec, facets_may_be_planes) {
  const auto read = [](const std::string& keys) {
    return parse_job(R"({"body": {)" + keys + R"(}, "material": "glass"})", "/jobs/job.json", BankKey::optional);
  };
  const std::string with = resolved_json(read(R"("surface": "die.obj", "facets": true)"), "/jobs", "");
  EXPECT_TRUE(read(R"("surface": "die.obj", "facets": true)").body->facets);
  EXPECT_NE(with.find("\"facets\""), std::string::npos);
  EXPECT_TRUE(parse_job(with, "/jobs/again.json", BankKey::optional).body->facets);
  const std::string without = resolved_json(read(R"("surface": "die.obj")"), "/jobs", "");
  EXPECT_EQ(without.find("facets"), std::string::npos) << "jobs without it keep their hash";
  EXPECT_EQ(resolved_json(read(R"("surface": "die.obj", "facets": false)"), "/jobs", ""), without);
  EXPECT_THROW(read(R"("surface": "die.obj", "facets": "yes")"), InputError);
  EXPECT_THROW(read(R"("shape": "bowl", "outer_radius_m": 0.06, "facets": true)"), InputError);
}

TEST(JobSpec, a_body_without_nodes_and_accuracy_is_a_preview) {
  const auto make = [](const std::string& body) {
    JobSpec job = parse_job("{" + body + ", \"material\": \"glass\"}", "/jobs/job.json", BankKey::optional);
    const bool is_preview = make_preview(job);
    return std::pair(is_preview, job);
  };
  EXPECT_EQ(make(R"("shape": {"bowl": {"outer_radius_m": 0.06}})").second.body->nodes, kPreviewShapeNodes);
  EXPECT_EQ(make(R"("body": {"surface": "cup.obj"})").second.body->nodes, kPreviewSolidNodes);
  EXPECT_EQ(make(R"("body": {"surface": "cup.obj", "wall_m": 0.002}, "max_modes": 7)").second.max_modes, 7);
  EXPECT_EQ(make(R"("shape": {"bowl": {"outer_radius_m": 0.06}})").second.max_modes, kPreviewModes);
  for (const char* other : {R"("shape": {"bowl": {"nodes": 900}})", R"("shape": {"bowl": {}}, "accuracy_cents": 5)", R"("mesh": "m.msh")",
                            R"("body": {"membrane": {"shape": "circle", "radius_m": 0.2, "lowest_hz": 200, "density_kg_m2": 0.3}})"})
    EXPECT_FALSE(make(other).first) << other;
  std::vector<std::int64_t> asked;
  const auto refuse = [&](std::int64_t nodes) {
    asked.push_back(nodes);
    if (nodes < 7000) throw carillon::CountRefusal("too few", 7000);
  };
  EXPECT_EQ(run_at_possible_count(6000, "ask for more", refuse), 7000);
  EXPECT_EQ(asked, (std::vector<std::int64_t>{6000, 7000}));
  EXPECT_THROW(run_at_possible_count(6000, "ask for more", [](std::int64_t) { throw carillon::CountRefusal("too few", 90000); }),
               InputError);
}

TEST(JobSpec, lame_constants_become_engineering_constants) {
  // references: lambda 3.99e9, mu 2.05e9 is E = 5.454 GPa, nu = 0.3303.
  const JobSpec job = parse_job(job_with(""), "/jobs/job.json");
  EXPECT_NEAR(job.material.young_modulus_pa, 5.454e9, 1e6);
  EXPECT_NEAR(job.material.poisson_ratio, 0.3303, 1e-4);
  EXPECT_NEAR(job.material.lame_lambda_pa() / 3.99e9, 1.0, 1e-13);
  EXPECT_NEAR(job.material.lame_mu_pa() / 2.05e9, 1.0, 1e-13);
}

TEST(JobSpec, the_resolved_job_resolves_to_itself) {
  const JobSpec job =
      parse_job(job_with(R"(, "element": "T4", "mass": "lumped", "max_modes": 7, "fixed": "x-min", "solver": {"tolerance": 1e-9})"),
                "/jobs/a/job.json");
  const std::string text = resolved_json(job, "/jobs/a/out", R"({"ranks": 2, "git": "abc"})");
  const JobSpec again = parse_job(text, "/jobs/a/out/b.bank.resolved.json");
  EXPECT_EQ(again.mesh, job.mesh);
  EXPECT_EQ(again.bank, job.bank);
  EXPECT_EQ(again.element, Element::T4);
  EXPECT_EQ(*again.max_modes, 7);
  EXPECT_EQ(again.fixed.at(0).node_set, "x-min");
  EXPECT_EQ(again.material.young_modulus_pa, job.material.young_modulus_pa);
  EXPECT_EQ(resolved_json(again, "/jobs/a/out", R"({"ranks": 2, "git": "abc"})"), text);
}

TEST(JobSpec, a_bank_linked_to_the_mesh_is_refused) {
  namespace fs = std::filesystem;
  const carillon::tests::Folder folder;
  std::ofstream(folder / "m.msh") << "mesh";
  fs::create_directory(folder / "out");
  fs::create_symlink(folder / "m.msh", folder / "out" / "b.bank");
  EXPECT_THROW(parse_job(job_with(""), folder / "job.json"), InputError);
}

TEST(JobSpec, a_resolved_job_may_overwrite_its_record) {
  EXPECT_NO_THROW(parse_job("{\"mesh\": \"m\", \"bank\": \"b\"," + kMaterial + "}", "/jobs/b.resolved.json"));
}

TEST(JobSpec, a_resolved_job_moves_with_its_folder) {
  const JobSpec job = parse_job(job_with(""), "/jobs/job.json");
  const JobSpec moved = parse_job(resolved_json(job, "/jobs/out", ""), "/elsewhere/out/b.bank.resolved.json");
  EXPECT_EQ(moved.mesh, "/elsewhere/m.msh");
}

TEST(JobSpec, mesh_scale_is_in_the_resolved_job) {
  const JobSpec plain = parse_job(job_with(""), "/jobs/job.json"),
                scaled = parse_job(job_with(", \"mesh_scale\": 0.001"), "/jobs/job.json");
  EXPECT_EQ(plain.mesh_scale, 1.0);
  EXPECT_EQ(scaled.mesh_scale, 0.001);
  const std::string text = resolved_json(scaled, "/jobs", "");
  EXPECT_NE(text, resolved_json(plain, "/jobs", ""));
  EXPECT_EQ(parse_job(text, "/jobs/b.bank.resolved.json").mesh_scale, 0.001);
  EXPECT_EQ(resolved_json(parse_job(text, "/jobs/b.bank.resolved.json"), "/jobs", ""), text);
  EXPECT_EQ(resolved_json(parse_job(job_with(", \"mesh_scale\": 1"), "/jobs/job.json"), "/jobs", ""), resolved_json(plain, "/jobs", ""));
}

std::vector<std::string> warnings_of(const std::string& material) {
  return parse_job("{\"mesh\": \"m\", \"bank\": \"b\",\n\n\"material\": {" + material + "}}", "/jobs/job.json").warnings;
}

TEST(JobSpec, values_in_other_units_are_warnings_with_a_line) {
  const std::string damping = R"(, "damping": {"internal_friction": {"tan_phi": 1e-3}})";
  EXPECT_TRUE(warnings_of(R"("young_modulus_pa": 72e9, "poisson_ratio": 0.22, "density_kg_m3": 2500)" + damping).empty());
  EXPECT_TRUE(warnings_of(R"("lame_lambda_pa": 3.99e9, "lame_mu_pa": 2.05e9, "density_kg_m3": 2700)" + damping).empty());
  for (
      const auto& [material, words] :
      {std::pair(R"("young_modulus_pa": 72, "poisson_ratio": 0.22, "density_kg_m3": 2.5)", "young_modulus_pa is 72: was it given in GPa?"),
       {R"("young_modulus_pa": 200, "poisson_ratio": 0.3, "density_kg_m3": 7850)", "young_modulus_pa is 200: was it given in GPa?"},
       {R"("young_modulus_pa": 200e9, "poisson_ratio": 0.3, "density_kg_m3": 7.85)", "density_kg_m3 is 7.85: was it given in g/cm^3?"},
       {R"("lame_lambda_pa": 3.99, "lame_mu_pa": 2.05, "density_kg_m3": 2700)", "lame_mu_pa is 2.05: was it given in GPa?"},
       {R"("orthotropic": {"young_modulus_pa": [11, 0.9, 0.5], "shear_modulus_pa": [0.7, 0.04, 0.6], "poisson_ratio": [0.37, 0.43, 0.47]}, "density_kg_m3": 400)",
        "orthotropic.young_modulus_pa is 11: was it given in GPa?"}}) {
    const auto warnings = warnings_of(material + damping);
    ASSERT_EQ(warnings.size(), 1U) << material;
    EXPECT_TRUE(warnings[0].starts_with("/jobs/job.json:3: ")) << warnings[0];
    EXPECT_NE(warnings[0].find(words), std::string::npos) << warnings[0];
  }
}

TEST(JobSpec, zero_damping_and_overdamping_are_warnings) {
  const std::string steel = R"("young_modulus_pa": 2e11, "poisson_ratio": 0.3, "density_kg_m3": 7850, "damping": )";
  for (const char* good : {R"({"rayleigh": {"alpha1_s": 1e-7}})", R"({"rayleigh": {"alpha2_per_s": 5}})",
                           R"({"internal_friction": {"tan_phi": 0.5}})", R"({"loss_table": [[100, 0], [1000, 0.1]]})"})
    EXPECT_TRUE(warnings_of(steel + good).empty()) << good;
  for (const char* none :
       {R"({"rayleigh": {}})", R"({"rayleigh": {"alpha1_s": 0, "alpha2_per_s": 0}})", R"({"internal_friction": {"tan_phi": 0}})",
        R"({"loss_table": [[100, 0]]})", R"({"caughey": {"coefficients": [0]}})"}) {
    const auto warnings = warnings_of(steel + none);
    ASSERT_EQ(warnings.size(), 1U) << none;
    EXPECT_NE(warnings[0].find("rings for ever"), std::string::npos) << warnings[0];
  }
  const auto strong = warnings_of(steel + R"({"rayleigh": {"alpha1_s": 1000}})");
  ASSERT_EQ(strong.size(), 1U);
  EXPECT_NE(strong[0].find("nothing of the band"), std::string::npos) << strong[0];
  EXPECT_NE(strong[0].find("alpha1_s is 1000 s"), std::string::npos) << strong[0];
}

class BadJobs : public testing::TestWithParam<BadJob> {};
TEST_P(BadJobs, are_refused_with_line_and_remedy) { carillon::tests::expect_refused(GetParam()); }

std::string material_with(const std::string& inside) { return "{\"mesh\": \"m\", \"bank\": \"b\",\n\n\"material\": {" + inside + "}}"; }
const std::string kDamping = R"(, "density_kg_m3": 1, "damping": {"rayleigh": {}})";

INSTANTIATE_TEST_SUITE_P(
    Table, BadJobs,
    testing::Values(
        BadJob{"mistyped_key", job_with(",\n\"elmnt\": \"T4\""), "job.json:3:", "did you mean \"element\"?"},
        BadJob{"mistyped_element", job_with(",\n\"element\": \"T11\""), "job.json:3:", "\"T4\", \"T10\""},
        BadJob{"no_mesh", "{" + kMaterial + ", \"bank\": \"b\"}", "job.json:1:", "\"mesh\" is missing"},
        BadJob{"mistyped_mesh", "{\n\"meshh\": \"m\", \"bank\": \"b\"}", "job.json:2:", "\"mesh\" is required"},
        BadJob{"no_material", R"({"mesh": "m", "bank": "b"})", "job.json:1:", "\"material\" is missing"},
        BadJob{"nu_half", material_with("\"young_modulus_pa\": 1,\n\"poisson_ratio\": 0.5" + kDamping),
               "job.json:4:", "between -1 and 0.5"},
        BadJob{"nu_minus_one", material_with("\"young_modulus_pa\": 1, \"poisson_ratio\": -1" + kDamping),
               "job.json:3:", "between -1 and 0.5"},
        BadJob{"both_pairs", material_with("\"young_modulus_pa\": 1, \"lame_mu_pa\": 1" + kDamping), "job.json:3:", "not both pairs"},
        BadJob{"soft_lambda", material_with("\"lame_lambda_pa\": -1, \"lame_mu_pa\": 1" + kDamping), "job.json:3:", "greater than -2/3"},
        BadJob{"no_density", material_with("\"young_modulus_pa\": 1, \"poisson_ratio\": 0.3, \"damping\": {\"rayleigh\": {}}"),
               "job.json:3:", "density_kg_m3"},
        BadJob{"zero_density",
               material_with("\"young_modulus_pa\": 1, \"poisson_ratio\": 0.3, \"density_kg_m3\": 0, \"damping\": {\"rayleigh\": {}}"),
               "job.json:3:", "greater than 0"},
        BadJob{
            "negative_damping",
            material_with(
                "\"young_modulus_pa\": 1, \"poisson_ratio\": 0.3, \"density_kg_m3\": 1, \"damping\": {\"rayleigh\": {\"alpha1_s\": -1}}"),
            "job.json:3:", "not be negative"},
        BadJob{"unknown_law",
               material_with("\"young_modulus_pa\": 1, \"poisson_ratio\": 0.3, \"density_kg_m3\": 1, \"damping\": {\"raleigh\": {}}"),
               "job.json:3:", "rayleigh"},
        BadJob{"band_reversed", job_with(",\n\"band_hz\": [20000, 20]"), "job.json:3:", "low < high"},
        BadJob{"band_of_three", job_with(",\n\"band_hz\": [1, 2, 3]"), "job.json:3:", "a list of 2 numbers"},
        BadJob{"no_modes", job_with(",\n\"max_modes\": 0"), "job.json:3:", "from 1 to"},
        BadJob{"half_a_mode", job_with(",\n\"max_modes\": 2.5"), "job.json:3:", "whole number"},
        BadJob{"fixed_both", job_with(",\n\"fixed\": {\"node_set\": \"a\", \"box_m\": {\"min\": [0,0,0], \"max\": [1,1,1]}}"),
               "job.json:3:", "one of"},
        BadJob{"fixed_empty", job_with(",\n\"fixed\": {}"), "job.json:3:", "one of"},
        BadJob{"box_reversed", job_with(",\n\"fixed\": {\"box_m\": {\"min\": [0,0,0], \"max\": [1,-1,1]}}"),
               "job.json:3:", "at least that of"},
        BadJob{"bank_is_mesh", "{\"mesh\": \"m\", \"bank\": \"x/../m\"," + kMaterial + "}", "job.json:1:", "overwrite the mesh"},
        BadJob{"bank_is_job", "{\"mesh\": \"m\", \"bank\": \"../jobs/job.json\"," + kMaterial + "}", "job.json:1:", "overwrite this job"},
        BadJob{"record_is_mesh", "{\"mesh\": \"b.resolved.json\", \"bank\": \"b\"," + kMaterial + "}", "job.json:1:", "overwrite the mesh"},
        BadJob{"pairs_mixed", material_with("\"young_modulus_pa\": 1,\n\"lame_mu_pa\": 1" + kDamping),
               "job.json:4: \"material.lame_mu_pa\"", "not both pairs"},
        BadJob{"stiffness_of_no_solid", material_with("\"young_modulus_pa\": 1e300,\n\"poisson_ratio\": 0.3" + kDamping),
               "job.json:3:", "check the unit"},
        BadJob{"nu_too_near_half", material_with("\"young_modulus_pa\": 1,\n\"poisson_ratio\": 0.4999999999" + kDamping),
               "job.json:4:", "too near"},
        BadJob{"lambda_too_large", material_with("\"lame_lambda_pa\": 1e12,\n\"lame_mu_pa\": 1" + kDamping), "job.json:3:", "too near"},
        BadJob{
            "density_of_nothing",
            material_with("\"young_modulus_pa\": 1, \"poisson_ratio\": 0.3,\n\"density_kg_m3\": 1e-300, \"damping\": {\"rayleigh\": {}}"),
            "job.json:4:", "check the unit"},
        BadJob{"band_without_end", job_with(",\n\"band_hz\": [20, 1e300]"), "job.json:3:", "must end at"},
        BadJob{"part_of_a_key", job_with(",\n\"fixed\": {\"box\": 1}"), "job.json:3:", "did you mean \"box_m\"?"},
        BadJob{"scale_of_nothing", job_with(",\n\"mesh_scale\": 0"), "job.json:3:", "greater than 0"},
        BadJob{"scale_of_the_sky", job_with(",\n\"mesh_scale\": 1e300"), "job.json:3:", "metres per unit of the mesh file"},
        BadJob{"scale_of_a_shape", "{\"body\": {\"shape\": \"bar\"}, \"bank\": \"b\",\n\"mesh_scale\": 0.001, " + kMaterial + "}",
               "job.json:2:", "inside \"body\""},
        BadJob{"more_nodes_than_the_mesher_makes",
               "{\"bank\": \"b\",\n\"body\": {\"shape\": \"bar\", \"nodes\": 20000001}, " + kMaterial + "}",
               "job.json:2:", "at most 20000000 nodes"},
        BadJob{"leading_zero", job_with(",\n\"max_modes\": 010"), "job.json:3:", "does not begin with a zero"},
        BadJob{"density_in_tons_per_cubic_millimetre",
               material_with(
                   "\"young_modulus_pa\": 210000, \"poisson_ratio\": 0.3,\n\"density_kg_m3\": 7.85e-9, \"damping\": {\"rayleigh\": {}}"),
               "job.json:4:", "t/mm^3"},
        BadJob{"tolerance", job_with(",\n\"solver\": {\"tolerance\": 1}"), "job.json:3:", "between"},
        BadJob{"path_is_number", "{\"mesh\": 5, \"bank\": \"b\"," + kMaterial + "}", "job.json:1:", "text in quotes"}),
    [](const auto& info) { return info.param.name; });

}  // namespace
