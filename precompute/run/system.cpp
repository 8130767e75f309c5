#include <fmt/core.h>

#include "precompute/eigen/types.hpp"
#include "precompute/fem/element.hpp"
#include "precompute/run/stages.hpp"
#include "runtime/base/error.hpp"

namespace carillon::run {
namespace {

/// Before the assembly.
void check_method(const Run& run, std::int64_t unknowns) {
  if (run.job.method != job::Method::dense || unknowns <= eigen::kMaxDenseUnknowns) return;
  throw InputError(fmt::format("{}: \"solver.method\": \"dense\" solves up to {} unknowns, and the body has {}; take \"automatic\"",
                               run.job.file.string(), eigen::kMaxDenseUnknowns, unknowns));
}

/// Before the solve.
void check_pieces(const Run& run, const Body& body) {
  if (!run.job.nonlinear || body.pieces.components == 1) return;
  throw InputError(
      fmt::format("{}: \"nonlinear\" needs a connected body, and this one has {} parts: solve each part separately, or "
                  "remove \"nonlinear\"",
                  run.job.file.string(), body.pieces.components));
}

/// Elements that cannot bend without the strain to which the solid is stiffest are too stiff; docs/elements.md.
void warn_of_locking(Run& run, const material::Material& material, bool is_linear) {
  constexpr double kStiff = 50;
  if (is_linear && material.poisson_ratio > 0.4)
    run.log.warn(
        fmt::format("T4 locks at a Poisson's ratio of {:g}: its frequencies will be several per cent sharp; use \"element\": \"T10\"",
                    material.poisson_ratio));
  if (!material.orthotropic) return;
  material::Elasticity c = material.calc_elasticity_pa();
  const double mean = fem::calc_mean_dilatation_modulus_pa(c);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) c[6 * i + j] -= mean;
  const auto stiffness = material::calc_eigenvalues(c);
  if (stiffness[5] > kStiff * stiffness[4])
    run.log.warn(fmt::format(
        "{}: the solid is {:.0f} times stiffer in one strain than in any other: coarse meshes lock and are some per cent sharp; "
        "compare with a finer one",
        material.place, stiffness[5] / stiffness[4]));
}

}  // namespace

AssembledSystem assemble_system(Run& run, const Setting& setting, const Body& body) {
  check_method(run, 3 * body.pieces.free_nodes);
  check_pieces(run, body);
  run.log.begin("assemble", fmt::format("{} unknowns, {}, {} mass", 3 * body.pieces.free_nodes, job::to_text(setting.element),
                                        job::to_text(run.job.mass)));
  const mesh::LocalMesh& mesh = body.pieces.local;
  AssembledSystem system;
  BodyProperties& properties = system.properties;
  properties.materials =
      fem::find_materials(run.comm, mesh, run.job, body.region_names, body.file_materials);  // its errors name the job's line
  for (const std::string& remark : properties.materials.remarks) run.log.warn_once(remark);
  system.matrices = name_errors(body.source, run, [&] { return fem::assemble(run.comm, mesh, properties.materials, run.job.mass); });
  properties.volume_m3 = fem::calc_volumes(run.comm, mesh, properties.materials);
  properties.rigid = fem::calc_rigid_body(run.comm, mesh, properties.materials);
  const bool is_linear = setting.element == job::Element::T4;
  for (const material::Material& material : properties.materials.list) warn_of_locking(run, material, is_linear);
  run.log.end();
  return system;
}

}  // namespace carillon::run
