#include "runtime/bank/layout.hpp"

#include <bit>
#include <charconv>

#include "runtime/bank/select.hpp"

namespace carillon::bank {

// Arrays are copied unchanged between file and memory.
static_assert(std::endian::native == std::endian::little, "Bank files are little-endian; big-endian machines are not supported.");
static_assert(sizeof(Vec3) == 24 && sizeof(std::array<std::int32_t, 3>) == 12, "Rows of three must lie without gaps.");

namespace {

std::string text_type(const std::string& text) { return "|S" + std::to_string(text.size()); }

template <class Vector>
std::vector<std::uint64_t> find_shape(const Vector& values) {
  return {values.size()};
}

/// Texts of the file have at least one byte.
std::string pad_text(const std::string& text) { return text.empty() ? std::string(1, '\0') : text; }

/// Fields since versions 1.5 and 1.6.
void add_radiation_fields(const Multipoles& air, const FileForm& form, std::vector<Field>& fields) {
  const auto add_number = [&](const char* name, const char* units, const char* meaning, const double& value) {
    fields.push_back({name, "<f8", {}, units, meaning, &value});
  };
  const auto add_list = [&](const char* name, const char* units, const char* meaning, const std::vector<double>& values) {
    fields.push_back({name, "<f8", find_shape(values), units, meaning, values.data()});
  };
  fields.push_back({"radiation/centre_m", "<f8", {3}, "m", "of the sphere around the surface", air.centre_m.data()});
  add_number("radiation/radius_m", "m", "of the sphere, R", air.radius_m);
  add_number("radiation/nearest_m", "m", "from the centre: radiation/error_db is stated from there outward", air.nearest_m);
  add_number("radiation/air_density_kg_m3", "kg/m^3", "of the air", air.air_density_kg_m3);
  add_number("radiation/sound_speed_ms", "m/s", "in the air", air.sound_speed_ms);
  add_list("radiation/freq_hz", "Hz", "of the mode in air, undamped", air.freq_hz);
  fields.push_back({"radiation/order", "<i4", find_shape(air.order), "1", "L of the mode: (L + 1)^2 coefficients", air.order.data()});
  add_list("radiation/scale", "Pa s m^-1 kg^-1/2", "of one integer step of the mode's coefficients", air.scale);
  fields.push_back({"radiation/coefficient",
                    "<i2",
                    {air.coefficient.size() / 2, 2},
                    "radiation/scale",
                    "pressure on the sphere, real and imaginary part, mode by mode: docs/bank-format.md",
                    air.coefficient.data()});
  add_list("radiation/decay", "1/s", "what radiation adds to the decay", air.decay_per_s);
  add_list("radiation/added_mass", "1", "of the air, over the modal mass", air.added_mass);
  add_list("radiation/error_db", "dB", "of the pressure, rms over directions, over its rms", air.error_db);
  if (const Mixing& mixing = air.mixing; !mixing.is_empty()) {
    fields.push_back({"radiation/mixing_count", "<i4", find_shape(mixing.count), "1", "parts of the mode in air", mixing.count.data()});
    fields.push_back({"radiation/mixing_motion", "<i4", find_shape(mixing.motion), "1",
                      "number of the mode without air that the part is of; from the number of modes on, rigid motions",
                      mixing.motion.data()});
    add_list("radiation/mixing_part", "1", "of that motion in the mode in air", mixing.part);
  }
  fields.push_back({"radiation/method", text_type(form.radiation_method), {}, "1", "how the air was solved", form.radiation_method.data()});
}

/// Fields since version 1.7.
void add_nonlinear_fields(const QuarticEnergy& energy, const FileForm& form, std::vector<Field>& fields) {
  const std::uint64_t modes = energy.mode_count(), rows = energy.row_count(), points = energy.point_count();
  fields.push_back({"nonlinear/modes", "<i4", {modes}, "1", "numbers of the coupled modes", energy.modes.data()});
  fields.push_back({"nonlinear/form", text_type(form.nonlinear_form), {}, "1", "rows or points", form.nonlinear_form.data()});
  if (energy.is_of_points()) {
    fields.push_back({"nonlinear/G",
                      "<f4",
                      {points, energy.gradient_count(), modes},
                      "m^-1 kg^-1/2",
                      "gradients of the modes at the points",
                      energy.gradient.data()});
    fields.push_back({"nonlinear/stress", "<f4", {rows, points, energy.strain_count()}, "J^1/2", "of each row", energy.stress.data()});
    fields.push_back({"nonlinear/weight", "<f8", {points}, "1", "of the points", energy.weight.data()});
  } else {
    fields.push_back({"nonlinear/A",
                      "<f4",
                      {rows, count_pairs(energy.mode_count())},
                      "J^1/2 m^-2 kg^-1",
                      "symmetric matrices, upper triangle by columns",
                      energy.rows.data()});
  }
  if (!energy.linear.empty())
    fields.push_back({"nonlinear/linear", "<f8", {rows, modes}, "J^1/2 m^-1 kg^-1/2", "of a curved body", energy.linear.data()});
  fields.push_back({"nonlinear/rest_energy_j", "<f8", {}, "J", "added to keep the energy positive", &energy.rest_energy_j});
  fields.push_back({"nonlinear/error", "<f8", {}, "1", "of the energy by its points", &energy.error});
  fields.push_back(
      {"nonlinear/membrane_ratio", "<f8", {}, "1", "highest coupled frequency over the lowest condensed one", &energy.membrane_ratio});
  fields.push_back({"nonlinear/thickness_m", "<f8", {}, "m", "by which amplitudes are judged", &energy.thickness_m});
}

/// Fields since version 1.9.
void add_sensitivity_fields(const Sensitivities& s, const FileForm& form, std::vector<Field>& fields) {
  const std::uint64_t columns = s.column_count(), sites = s.site_count();
  fields.insert(
      fields.end(),
      {{"sensitivity/modes", "<i4", {columns, 2}, "1", "mode of the column, twice, or two near modes that a cut mixes", s.modes.data()},
       {"sensitivity/scale", "<f8", {columns}, "cent mm^-1 m^-2", "of one integer step", s.scale.data()},
       {"sensitivity/density",
        "<i2",
        {sites, columns},
        "sensitivity/scale",
        "change of the frequency by removed material, per area",
        s.density.data()},
       {"sensitivity/vertex", "<i4", {sites}, "1", "of the site; vertices of sharp edges have a site for each side", s.vertex.data()},
       {"sensitivity/normal", "<f4", {sites, 3}, "1", "outward", s.normal.data()},
       {"sensitivity/area_m2", "<f4", {sites}, "m^2", "of the site", s.area_m2.data()},
       {"sensitivity/doubtful", "|u1", {sites}, "1", "1 near inward edges and fixed nodes", s.doubtful.data()},
       {"sensitivity/parameters", text_type(form.parameters), {}, "1", "JSON list of names", form.parameters.data()},
       {"sensitivity/by_parameter",
        "<f8",
        {s.count, s.count > 0 ? s.by_parameter.size() / s.count : 0},
        "1",
        "d ln f / d ln parameter; of Poisson's ratios d ln f / d nu",
        s.by_parameter.data()}});
  if (!s.own_error_cents.empty())
    fields.push_back({"sensitivity/own_error_cents",
                      "<f8",
                      {s.own_error_cents.size()},
                      "cent",
                      "estimate: this mode of the body, known by its shape, is no further from its corrected frequency",
                      s.own_error_cents.data()});
}

void add_proof_fields(const Proof& proof, const FileForm& form, std::vector<Field>& fields) {
  const auto& rigid = proof.rigid_per_component;
  fields.insert(
      fields.end(),
      {{"proof/cut_hz", "<f8", find_shape(proof.cut_hz), "Hz", "where eigenvalues were counted", proof.cut_hz.data()},
       {"proof/below", "<i8", find_shape(proof.below), "1", "eigenvalues below the cut, by inertia", proof.below.data()},
       {"proof/margin", "<f8", find_shape(proof.margin), "1", "relative distance in lambda to the nearest mode", proof.margin.data()},
       {"proof/rigid_per_component", "<i8", find_shape(rigid), "1", "rigid motions of each component", rigid.data()},
       {"proof/found", "<i8", {}, "1", "modes found between the first and the last cut", &proof.found},
       {"proof/orthonormality", "<f8", {}, "1", "max |phi_i^T M phi_j - delta_ij|", &proof.orthonormality},
       {"proof/backward_error", "<f8", {}, "1", "of the worst factorisation", &proof.backward_error},
       {"proof/cluster_first", "<i8", find_shape(proof.cluster_first), "1", "first of a group of degenerate modes",
        proof.cluster_first.data()},
       {"proof/cluster_count", "<i8", find_shape(proof.cluster_count), "1", "modes of the group", proof.cluster_count.data()},
       {"proof/method", text_type(form.proof_method), {}, "1", "how it was counted", form.proof_method.data()}});
  if (!proof.below_band_hz.empty())
    fields.push_back({"proof/below_band_hz", "<f8", find_shape(proof.below_band_hz), "Hz",
                      "modes of the mesh whose corrected frequencies are below the band", proof.below_band_hz.data()});
  if (form.has_complete_below)
    fields.push_back({"proof/complete_below_hz",
                      "<f8",
                      {},
                      "Hz",
                      "every mode of the mesh from the first cut to here is in the bank",
                      &proof.complete_below_hz});
}

/// Fields since version 1.1.
void add_later_fields(const Bank& bank, const FileForm& form, std::vector<Field>& fields) {
  const auto add_errors = [&](const char* name, const char* meaning, const std::vector<double>& cents) {
    if (!cents.empty()) fields.push_back({name, "<f8", find_shape(cents), "cent", meaning, cents.data()});
  };
  add_errors("modes/algebraic_error_cents", "bound: the exact mode of the mesh is no further", bank.algebraic_error_cents);
  add_errors("modes/discretisation_error_cents", "estimate: the mode of the body is no further", bank.discretisation_error_cents);
  add_errors("modes/facet_error_cents", "estimate: beyond its bar a mode is no further if the facets are not what they were taken for",
             bank.facet_error_cents);
  if (const Corrected& corrected = bank.corrected; !corrected.is_empty()) {
    fields.insert(fields.end(), {{"modes/corrected_frequency_hz", "<f8", find_shape(corrected.freq_hz), "Hz",
                                  "undamped, with the estimated error of the mesh taken off", corrected.freq_hz.data()},
                                 {"modes/corrected_decay", "<f8", find_shape(corrected.decay_per_s), "1/s",
                                  "by the damping law at the corrected frequency", corrected.decay_per_s.data()},
                                 {"modes/corrected_error_cents", "<f8", find_shape(corrected.error_cents), "cent",
                                  "estimate: the k-th mode of the body is no further from the k-th lowest corrected frequency",
                                  corrected.error_cents.data()},
                                 {"modes/correction", "|u1", find_shape(corrected.correction), "1",
                                  "why it was corrected or not: docs/bank-format.md", corrected.correction.data()}});
  }
  if (!form.damping_law.empty()) {
    const Damping& damping = bank.damping;
    fields.push_back({"damping/law", text_type(form.damping_law), {}, "1", "how the decays came about", form.damping_law.data()});
    fields.push_back({"damping/coefficient", "<f8", find_shape(damping.coefficient), "s^(2 power - 1); 1 for internal friction",
                      "constants of the law", damping.coefficient.data()});
    fields.push_back({"damping/power", "<f8", find_shape(damping.power), "1", "of lambda, a Caughey series", damping.power.data()});
    fields.push_back({"damping/freq_hz", "<f8", find_shape(damping.freq_hz), "Hz", "of the table", damping.freq_hz.data()});
    fields.push_back({"damping/loss_factor", "<f8", find_shape(damping.loss_factor), "1", "of the table", damping.loss_factor.data()});
  }
  if (!form.regions.empty())
    fields.push_back({"material/regions", text_type(form.regions), {}, "1", "JSON text: materials by region", form.regions.data()});
  if (!form.supports.empty()) {
    const Supports& s = bank.supports;
    const std::uint64_t count = s.count(), modes = bank.mode_count();
    fields.insert(fields.end(),
                  {{"supports/text", text_type(form.supports), {}, "1", "JSON text: names, and what is behind them", form.supports.data()},
                   {"supports/centre_m", "<f8", {count, 3}, "m", "of the patch of fixed nodes", s.centre_m.data()},
                   {"supports/normal", "<f8", {count, 3}, "1", "out of the body; 0 of a patch without area", s.normal.data()},
                   {"supports/area_m2", "<f8", {count}, "m^2", "of the patch", s.area_m2.data()},
                   {"supports/thickness_m", "<f8", {count}, "m", "short side of the patch", s.thickness_m.data()},
                   {"modes/support_reaction",
                    "<f8",
                    {modes, count, 6},
                    "N m^-1 kg^-1/2, N kg^-1/2",
                    "force on the body, couple about the centre, for unit modal amplitude",
                    s.reaction.data()},
                   {"modes/support_energy",
                    "<f8",
                    {modes, count},
                    "1",
                    "share of the strain energy within one thickness of the patch",
                    s.energy.data()}});
  }
  if (!bank.multipoles.is_empty()) add_radiation_fields(bank.multipoles, form, fields);
  if (!bank.quartic.is_empty()) add_nonlinear_fields(bank.quartic, form, fields);
  if (!bank.sensitivities.is_empty()) add_sensitivity_fields(bank.sensitivities, form, fields);
  if (bank.proof) add_proof_fields(*bank.proof, form, fields);
}

/// Fields of packed banks that replace mesh and shapes.
void add_packed_fields(const Bank& bank, const FileForm& form, std::vector<Field>& fields) {
  const Packing& packing = *bank.packing;
  fields.insert(
      fields.end(),
      {{"mesh/packed", "|u1", find_shape(form.packed_surface), "1", "vertices and triangles, packed: docs/bank-format.md",
        form.packed_surface.data()},
       {"modes/packed_shape", "|u1", find_shape(form.packed_shape), "1", "shapes, packed: docs/bank-format.md", form.packed_shape.data()},
       {"pack/error_db",
        "<f8",
        {},
        "dB(A)",
        "error of a hard blow relative to the blow: no greater on 95 % of the surface",
        &packing.error_db},
       {"pack/worst_db", "<f8", {}, "dB(A)", "the same where it is greatest", &packing.worst_db},
       {"pack/witness", "<i4", find_shape(packing.witness), "1", "vertices whose shapes before packing are here", packing.witness.data()},
       {"pack/witness_shape",
        "<i2",
        {packing.witness.size(), bank.mode_count(), 3},
        "modes/shape_scale",
        "their shapes before packing",
        packing.witness_shape.data()}});
  if (!form.packed_order.empty())
    fields.push_back({"mesh/packed_order", "|u1", find_shape(form.packed_order), "1",
                      "numbers of the triangles, packed: docs/bank-format.md", form.packed_order.data()});
}

}  // namespace

std::vector<Field> list_fields(const Bank& bank, const FileForm& form) {
  const std::uint64_t vertices = bank.vertices_m.size();
  const std::uint64_t triangles = bank.triangles.size();
  const std::uint64_t modes = bank.eigenvalue_rad2_s2.size();
  const RigidBody& rigid = bank.rigid;
  const Material& material = bank.material;
  const Counts& counts = bank.counts;
  const bool is_narrow = bank.shape_bytes == 1;
  std::vector<Field> fields;
  if (!form.is_packed)
    fields = {
        {"mesh/vertices", "<f8", {vertices, 3}, "m", "surface vertices", bank.vertices_m.data()},
        {"mesh/triangles", "<i4", {triangles, 3}, "1", "vertices of a triangle, counter-clockwise from outside", bank.triangles.data()},
        {"modes/shape",
         is_narrow ? "|i1" : "<i2",
         {vertices, modes, 3},
         "modes/shape_scale",
         "phi = shape * shape_scale, mass-normalised",
         is_narrow ? static_cast<const void*>(form.narrow_shape.data()) : bank.shape.data()}};
  else
    add_packed_fields(bank, form, fields);
  const std::vector<Field> common{
      {"modes/eigenvalue", "<f8", {modes}, "rad^2/s^2", "lambda = omega^2, ascending", bank.eigenvalue_rad2_s2.data()},
      {"modes/frequency_hz", "<f8", {modes}, "Hz", "undamped, sqrt(lambda) / 2 pi", form.freq_hz.data()},
      {"modes/decay", "<f8", {modes}, "1/s", "d = (alpha1 lambda + alpha2) / 2", bank.decay_per_s.data()},
      {"modes/residual", "<f8", {modes}, "1", "||K phi - lambda M phi|| / (lambda ||M phi||)", bank.residual.data()},
      {"modes/radiation_gain", "<f8", {modes}, "Pa s m^-1 kg^-1/2", "pressure at 1 m for unit modal velocity", bank.radiation_gain.data()},
      {"modes/shape_scale", "<f8", {modes}, "kg^-1/2", "of one integer step of modes/shape", bank.shape_scale.data()},
      {"rigid/mass_kg", "<f8", {}, "kg", "mass", &rigid.mass_kg},
      {"rigid/centre_m", "<f8", {3}, "m", "centre of mass", rigid.centre_m.data()},
      {"rigid/inertia_kg_m2", "<f8", {3, 3}, "kg m^2", "about the centre of mass, axes of the mesh", rigid.inertia_kg_m2.data()},
      {"rigid/volume_m3", "<f8", {}, "m^3", "volume", &rigid.volume_m3},
      {"material/young_modulus_pa", "<f8", {}, "Pa", "Young's modulus", &material.young_modulus_pa},
      {"material/poisson_ratio", "<f8", {}, "1", "Poisson's ratio", &material.poisson_ratio},
      {"material/density_kg_m3", "<f8", {}, "kg/m^3", "density", &material.density_kg_m3},
      {"material/alpha1_s", "<f8", {}, "s", "stiffness-proportional damping", &material.alpha1_s},
      {"material/alpha2_per_s", "<f8", {}, "1/s", "mass-proportional damping", &material.alpha2_per_s},
      {"solve/nodes", "<i8", {}, "1", "nodes of the volume mesh as solved", &counts.nodes},
      {"solve/tets", "<i8", {}, "1", "tetrahedra of the volume mesh", &counts.tets},
      {"solve/components", "<i8", {}, "1", "connected components", &counts.components},
      {"solve/rigid_modes", "<i8", {}, "1", "rigid modes that were deflated", &counts.rigid_modes},
      {"solve/band_hz", "<f8", {2}, "Hz", "modes were looked for from here to there", bank.band_hz.data()},
      {"solve/complete", "|u1", {}, "1", "1 when every mode of the band is here", &form.complete},
      {"solve/element", text_type(form.element), {}, "1", "T4, T10, analytic or imported", form.element.data()},
      {"solve/mass", text_type(form.mass), {}, "1", "consistent or lumped", form.mass.data()},
      {"provenance", text_type(form.provenance), {}, "1", "JSON text", form.provenance.data()},
  };
  fields.insert(fields.end(), common.begin(), common.end());
  add_later_fields(bank, form, fields);
  return fields;
}

FileForm make_file_form(const Bank& bank) {
  FileForm form;
  for (std::size_t i = 0; i < bank.mode_count(); ++i) form.freq_hz.push_back(bank.freq_hz(i));
  form.complete = bank.complete ? 1 : 0;
  form.element = pad_text(bank.element);
  form.mass = pad_text(bank.mass);
  form.provenance = pad_text(bank.provenance);
  form.damping_law = pad_text(bank.damping.law);
  form.regions = bank.regions;
  if (bank.supports.count() > 0) form.supports = pad_text(bank.supports.text);
  if (bank.proof) form.proof_method = pad_text(bank.proof->method);
  if (!bank.multipoles.is_empty()) form.radiation_method = pad_text(bank.multipoles.method);
  if (!bank.quartic.is_empty()) form.nonlinear_form = bank.quartic.is_of_points() ? "points" : "rows";
  if (!bank.sensitivities.is_empty()) form.parameters = pad_text(bank.sensitivities.parameters);
  form.has_complete_below = bank.proof && bank.proof->complete_below_hz > 0.0;
  if (bank.shape_bytes == 1) form.narrow_shape.assign(bank.shape.begin(), bank.shape.end());  // range checked by find_faults()
  return form;
}

std::array<int, 2> find_version(const Bank& bank, bool is_packed) {
  const bool is_cut_across = bank.proof && (!bank.proof->below_band_hz.empty() || (bank.complete && bank.proof->complete_below_hz > 0.0));
  const bool has_outside = !bank.corrected.is_empty() && bank.mode_count() > 0 &&
                           (!is_above_begin(bank.freq_hz(0), bank.band_hz[0]) || bank.freq_hz(bank.mode_count() - 1) > bank.band_hz[1]);
  if (!bank.sensitivities.is_empty() || is_cut_across || has_outside) return is_packed ? std::array{2, 5} : std::array{1, 9};
  if (bank.element == "imported" || !bank.facet_error_cents.empty()) return is_packed ? std::array{2, 4} : std::array{1, 8};
  if (!bank.quartic.is_empty()) return is_packed ? std::array{2, 3} : std::array{1, 7};
  const bool is_mixed = !bank.multipoles.mixing.is_empty();
  if (is_packed) return {2, bank.multipoles.is_empty() ? 0 : is_mixed ? 2 : 1};
  if (!bank.multipoles.is_empty()) return {1, is_mixed ? 6 : 5};
  return {1, !bank.corrected.is_empty() || bank.element == "analytic" ? 4 : bank.supports.count() > 0 ? 3 : bank.shape_bytes == 1 ? 2 : 1};
}

std::uint64_t find_item_bytes(const std::string& dtype) {
  if (dtype == "<f8" || dtype == "<i8") return 8;
  if (dtype == "<i4" || dtype == "<f4") return 4;
  if (dtype == "<i2") return 2;
  if (dtype == "|u1" || dtype == "|i1") return 1;
  if (dtype.size() < 3 || dtype.size() > 12 || dtype.substr(0, 2) != "|S") return 0;
  std::uint64_t bytes = 0;
  const auto [end, error] = std::from_chars(dtype.data() + 2, dtype.data() + dtype.size(), bytes);
  return error == std::errc() && end == dtype.data() + dtype.size() ? bytes : 0;
}

std::uint64_t calc_bytes(const Field& field) {
  std::uint64_t bytes = find_item_bytes(field.dtype);
  for (const std::uint64_t extent : field.shape) bytes *= extent;
  return bytes;
}

}  // namespace carillon::bank
