#include "precompute/run/bank_content.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <utility>

#include "precompute/run/describe_run.hpp"
#include "precompute/run/modes.hpp"
#include "runtime/bank/of_material.hpp"
#include "runtime/bank/select.hpp"
#include "runtime/base/json.hpp"

namespace carillon::run {
namespace {

bank::Damping make_damping(const fem::Materials& materials) {
  if (materials.list.size() == 1) return bank::make_damping(materials.list[0]);
  bank::Damping damping;
  damping.law = "mixed";
  return damping;
}

/// A single material unchanged; several as their isotropic equivalent, with the mean density.
bank::Material make_material(const SolvedBody& solved) {
  const auto& list = solved.properties.materials.list;
  bank::Material material;
  if (list.size() == 1) {
    material = {list[0].young_modulus_pa, list[0].poisson_ratio, list[0].density_kg_m3, 0.0, 0.0};
    if (list[0].law == material::DampingLaw::rayleigh) {
      material.alpha1_s = list[0].alpha1_s;
      material.alpha2_per_s = list[0].alpha2_per_s;
    }
  } else {
    const material::Equivalent equivalent = material::calc_equivalent(list, solved.properties.volume_m3);
    material = {equivalent.young_modulus_pa, equivalent.poisson_ratio, equivalent.density_kg_m3, 0.0, 0.0};
  }
  return material;
}

std::string make_regions(const SolvedBody& solved) {
  const auto& materials = solved.properties.materials;
  const bool is_plain = materials.list.size() == 1 && !materials.list[0].orthotropic;
  return is_plain ? std::string() : describe_materials(materials, solved.properties.volume_m3).sorted_text();
}

/// Names from the job, the node set or the box; several patches of one entry are numbered.
bank::Supports make_supports(const job::JobSpec& job, const fem::Supports& found) {
  bank::Supports supports;
  base::Json supports_json = base::Json::object();
  std::map<std::int32_t, int> patches, seen;
  for (const fem::Support& support : found.list) ++patches[support.entry];
  for (const fem::Support& support : found.list) {
    const job::Fixed& fixed = job.fixed[support.entry];
    std::string name = !fixed.name.empty() ? fixed.name : fixed.node_set ? *fixed.node_set : fmt::format("box {}", support.entry + 1);
    if (patches[support.entry] > 1) name += fmt::format(":{}", ++seen[support.entry]);
    supports_json["supports"].add(material::write_fixing(fixed.fixing, base::Json::object().set("name", name)));
    supports.centre_m.push_back(support.centre_m);
    supports.normal.push_back(support.normal);
    supports.area_m2.push_back(support.area_m2);
    supports.thickness_m.push_back(support.thickness_m);
  }
  if (!found.list.empty()) supports.text = supports_json.line();
  supports.reaction = found.reaction;
  supports.energy = found.energy;
  return supports;
}

bank::Corrected make_corrected(const SolvedBody& solved) {
  const error_bars::Corrections& found = solved.errors.bars.corrected;
  bank::Corrected corrected;
  for (std::size_t m = 0; m < found.lambda.size(); ++m) {
    corrected.freq_hz.push_back(std::sqrt(found.lambda[m]) / (2 * std::numbers::pi));
    corrected.error_cents.push_back(found.cents[m] + solved.errors.bars.algebraic_cents[m]);
  }
  corrected.correction = found.correction;
  corrected.decay_per_s = fem::calc_decay_per_s(solved.properties.materials, solved.errors.shares, found.lambda);
  return corrected;
}

/// The larger of the values for the mesh's and for the corrected frequency.
std::vector<double> find_facet_cents(const error_bars::ErrorBars& bars) {
  std::vector<double> cents = bars.facet_cents;
  for (std::size_t m = 0; m < cents.size(); ++m) cents[m] = std::max(cents[m], bars.corrected.facet_cents[m]);
  return cents;
}

bank::Proof make_proof(const eigen::Modes& modes) {
  bank::Proof proof;
  for (const eigen::Count& count : modes.proof.counts) {
    proof.cut_hz.push_back(count.freq_hz);
    proof.below.push_back(count.below);
    proof.margin.push_back(std::min(count.margin, 1.0));
  }
  proof.rigid_per_component = modes.proof.rigid_per_component;
  proof.found = modes.proof.found;
  proof.orthonormality = modes.orthonormality_error;
  proof.backward_error = modes.proof.factor_backward_error;
  for (const eigen::Cluster& cluster : modes.proof.clusters) {
    proof.cluster_first.push_back(cluster.first);
    proof.cluster_count.push_back(cluster.count);
  }
  proof.method = modes.proof.method;
  return proof;
}

}  // namespace

bank::Bank make_bank(const job::JobSpec& job, Solution& found, io::SurfaceModes& surface_modes) {
  Body& body = found.body;
  const SolvedBody& solved = found.solved;
  const eigen::Modes& modes = solved.modes;
  bank::Bank bank;
  bank.vertices_m = std::move(body.surface.vertices_m);
  bank.triangles = std::move(body.surface.triangles);
  bank.eigenvalue_rad2_s2 = modes.lambda;
  bank.residual = modes.residual;
  bank.decay_per_s = solved.errors.decay_per_s;
  bank.radiation_gain = std::move(surface_modes.radiation_gain);
  bank.shape_scale = std::move(surface_modes.shape_scale);
  bank.shape = std::move(surface_modes.shape);
  bank.algebraic_error_cents = solved.errors.bars.algebraic_cents;
  bank.discretisation_error_cents = solved.errors.bars.discretisation_cents;
  bank.facet_error_cents = find_facet_cents(solved.errors.bars);
  bank.corrected = make_corrected(solved);
  bank.rigid = {solved.properties.rigid.mass_kg, solved.properties.rigid.centre_m, solved.properties.rigid.inertia_kg_m2,
                solved.properties.rigid.volume_m3};
  bank.material = make_material(solved);
  bank.damping = make_damping(solved.properties.materials);
  bank.regions = make_regions(solved);
  bank.supports = make_supports(job, solved.errors.supports);
  bank.proof = make_proof(modes);
  bank.counts = {body.pieces.nodes, body.pieces.tets, body.pieces.components, modes.rigid_count};
  bank.band_hz = {find_low_hz(job, modes), job.band_hz[1]};
  bank.complete = modes.band_count == static_cast<std::int64_t>(modes.lambda.size());
  bank.element = job::to_text(found.setting.element);
  bank.mass = job::to_text(job.mass);
  if (job.max_modes) bank::keep_lowest(bank, static_cast<std::size_t>(*job.max_modes));
  return bank;
}

}  // namespace carillon::run
