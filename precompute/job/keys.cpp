#include "precompute/job/keys.hpp"

#include "runtime/material/material.hpp"

namespace carillon::job {

using base::kAboveZero;
using base::Limits;

const base::Keys<JobSpec> kJobKeys{
    {"mesh", "one form", "file of tetrahedra"},
    {"mesh_scale", "1", "metres per unit of the mesh file: 0.001 for millimetres; `fixed.box_m` is in metres, after scaling"},
    {"shape", "one form", "a parametric shape of `carillon-mesh`, `{\"bar\": {\"length_m\": 0.4, ...}}`"},
    {"body", "one form",
     "the same as `{\"shape\": \"bar\", ...}`, a surface with the keys below, or a [known body](bodies-with-known-modes.md)"},
    {"bank", "required by `carillon-precompute`", "path of the bank; `<bank>.resolved.json` next to it is a job with the same result"},
    {"shapes", &JobSpec::shapes, kShapesNames,
     "mode shapes in the bank: [packed](../packed-banks.md) with an error of -60 dB(A) if they take 1 MB or more, or unchanged"},
    {"sensitivities", &JobSpec::sensitivities, Limits{0, 1000},
     "number of the lowest modes with [sensitivities](tune-a-body.md#sensitivities) to cuts and constants, up to 8 more if these are "
     "within 1 % of the last; for one material"},
    {"accuracy_cents", &JobSpec::accuracy_cents, Limits{1e-3, 1200},
     "chooses element, mesh size and `solver.tolerance`: [choose-accuracy](choose-accuracy.md)"},
    {"material", "required", "name (`\"steel\"`) or object: [materials](materials.md); `\"file\"`: [of the mesh file](cae-meshes.md)"},
    {"materials", "none", "one material per region of the mesh, by tag or name; `material` is for the others"},
    {"band_hz", "`[20, 20000]`", "undamped frequencies to find; every mode of the band is found, or the program fails"},
    {"max_modes", &JobSpec::max_modes, Limits{1, 40000}, "maximum number of modes, the lowest of the band"},
    {"element", &JobSpec::element, kElementNames,
     "linear or quadratic tetrahedra, for any mesh file ([which](choose-accuracy.md#element-and-mesh), [elements](../elements.md))"},
    {"mass", &JobSpec::mass, kMassNames, "mass matrix"},
    {"fixed", "none", "fixed nodes: name of a node set, object with the keys below, or a list of both"},
    {"solver", "none", "eigensolver"},
    {"radiation", "`\"none\"`", "air around the body: [keys](hear-the-air.md#the-keys)"},
    {"nonlinear", "none", "coupling of modes in large motion: [keys](nonlinear-bodies.md#the-keys)"},
    {"resources", "none", "limits for [`carillon`](jobs.md); they do not affect the result"}};

const base::Keys<Body> kSurfaceKeys{
    {"surface", "required", "closed triangle surface (OBJ, STL, PLY, OFF, GLB); options as of `carillon-mesh`"},
    {"wall_m", &Body::wall_m, kBodyLength, "wall thickness; without it the body is solid"},
    {"side", &Body::side, {"middle", "outside", "inside"}, "position of the surface in the wall"},
    {"height_m", &Body::height_m, kBodyLength, "scales the body to this extent along `up`"},
    {"scale", &Body::scale, kAboveZero, "or metres per unit of the file"},
    {"close_holes", &Body::close_holes, Limits{0, 1}, "closes holes up to this share of the body's diagonal"},
    {"facets", &Body::facets, "facets are true planes, not samples of a smooth surface"},
    {"up", &Body::up, {"x", "y", "z"}, "axis of `height_m`"},
    {"method", &Body::method, {"auto", "delaunay", "stuffing", "extrude"}, "mesher"}};
const base::Keys<Body> kMeshSizeKeys{{"nodes", "10,000", "number of nodes of a shape or surface; 4 to 20,000,000"},
                                     {"edge_m", &Body::edge_m, kBodyLength, "or edge length of the elements"}};
const base::Keys<Fixed> kFixedKeys{{"node_set", &Fixed::node_set, "name of a node set of the mesh"},
                                   {"box_m", "none", "or all nodes in a box: `{\"min\": [x, y, z], \"max\": [x, y, z]}`"},
                                   {"name", "the node set's", "name of the support in scenes"},
                                   {"on", "rigid", "what is behind the nodes: [supports](materials.md#supports)"},
                                   {"joint", "none", "type of the joint, or its loss factor as `loss`"}};
const base::Keys<JobSpec> kSolverKeys{
    {"tolerance", &JobSpec::tolerance, Limits{1e-14, 1e-4, true}, "relative residual of every mode"},
    {"method", &JobSpec::method, kMethodNames,
     "`dense` is LAPACK, up to 8,000 unknowns; automatic up to 300, and to 3,000 if over 40 % of all modes are wanted"},
    {"factorisation", &JobSpec::factorisation, kFactorisationNames, "of shift-invert"}};
const base::Keys<Air> kAirKeys{
    {"method", &Air::method, kAirNames,
     "in an object `\"bem\"` by default. `none`: no solve. `bem`: boundary elements. `auto`: boundary elements if the roundness of the "
     "body, "
     "36 pi V²/A³ of its outer surface, is below 0.4 (sphere 1, cube 0.52, plate 0.02)"},
    {"skin_nodes", &Air::skin_nodes, Limits{100, 200'000}, "nodes of the surface for the air; a finer one is coarsened"},
    {"error_db", &Air::error_db, Limits{-80, -20, true}, "interpolation error over the frequency, per mode"},
    {"half_space", "none",
     "rigid plane: `{\"point_m\": [0, 0, 0], \"normal\": [0, 0, 1]}` in the frame of the mesh. The body is on the side of the normal. "
     "Takes "
     "four times as long"}};
const base::Keys<Nonlinear> kNonlinearKeys{
    {"form", &Nonlinear::is_stretch, {"full", "stretch"}, "all coupling, or that of the mean stretch"},
    {"modes", &Nonlinear::modes, Limits{1, kMaxCoupledModes}, "maximum number of coupled modes, the lowest that bend or twist"},
    {"below_hz", &Nonlinear::below_hz, kAboveZero, "maximum frequency of coupled modes"},
    {"energy_error", &Nonlinear::energy_error, Limits{1e-6, 0.1, true},
     "full coupling of elements only: relative error of the stored energy; 0.01 is one cent in a glide of a semitone"}};
const base::Keys<Resources> kResourceKeys{
    {"ranks", &Resources::ranks, Limits{1, 1'000'000}, "MPI ranks; predicted by default"},
    {"memory_gb", &Resources::memory_gb, Limits{0, 1e9, true},
     "[limit](jobs.md#who-runs-when) of all ranks together; predicted by default"},
    {"time_limit_s", &Resources::time_limit_s, Limits{0, 1e9, true}, "limit of one attempt; predicted by default"}};

namespace {

const base::Keys<Material> kMaterialKeys{
    {"from", "none", "name of a material, whose constants the other keys replace"},
    {"young_modulus_pa", "required", "isotropic elasticity, with `poisson_ratio`"},
    {"poisson_ratio", "required", "above -1, below 0.5"},
    {"lame_lambda_pa", "none", "Lamé's constants instead, with `lame_mu_pa`"},
    {"lame_mu_pa", "none", "shear modulus"},
    {"orthotropic", "none",
     "wood: `young_modulus_pa` [E1, E2, E3], `shear_modulus_pa` [G12, G23, G13], `poisson_ratio` [nu12, nu23, nu13], `axes`"},
    {"axes", "none", "directions 1 and 2 of wood, with `from`"},
    {"density_kg_m3", "required", "density"},
    {"damping", "required", "one of the four laws below"},
    {"damping.rayleigh", "", "`alpha1_s` and `alpha2_per_s`: decay rate `d = (alpha1 lambda + alpha2) / 2`"},
    {"damping.internal_friction", "", "`tan_phi`: `d = omega tan(phi) / 2`"},
    {"damping.caughey", "", "`coefficients` and `powers` (0, 1, 2, ...): `d = sum of a lambda^p / 2`"},
    {"damping.loss_table", "", "`[[frequency in Hz, loss factor], ...]`"},
    {"name", "none", "label in the resolved job"}};

}  // namespace

std::vector<base::KeyTable> describe_job_keys() {
  std::vector<base::KeyTable> tables{{"job", {}}, {"radiation", {}}, {"nonlinear", {}}};
  kJobKeys.describe(tables[0]);
  kSurfaceKeys.describe(tables[0], "body.");
  kMeshSizeKeys.describe(tables[0], "body.");
  kMaterialKeys.describe(tables[0], "material.");
  kFixedKeys.describe(tables[0], "fixed.");
  kSolverKeys.describe(tables[0], "solver.");
  kResourceKeys.describe(tables[0], "resources.");
  kAirKeys.describe(tables[1], "radiation.");
  kNonlinearKeys.describe(tables[2], "nonlinear.");
  for (base::KeyTable& table : describe_analytic_keys()) tables.push_back(std::move(table));
  return tables;
}

}  // namespace carillon::job
