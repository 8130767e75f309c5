#include "precompute/simulation/bodies.hpp"

#include <fmt/core.h>
#include <mpi.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <set>
#include <variant>

#include "precompute/mesh/check.hpp"
#include "precompute/mesh/read.hpp"
#include "precompute/run/meshing.hpp"
#include "precompute/simulation/transient/bend.hpp"
#include "runtime/base/clock.hpp"
#include "runtime/base/error.hpp"

namespace carillon::simulation {
namespace {

constexpr double kMaxStrikeDistanceRatio = 0.05;  // over the body's extent: largest distance of an impulse's point from the skin
constexpr double kMaxTableDistanceRatio = 1e-4;   // over the body's extent: largest distance of a table row from its node

/// Runs `work` for a body; adds the job line to its InputError.
template <typename Work>
auto name_place(const std::string& place, Work&& work) {
  try {
    return work();
  } catch (const InputError& error) {
    if (std::string_view(error.what()).starts_with(place)) throw;
    throw InputError(fmt::format("{}: {}", place, error.what()));
  }
}

transient::Law make_law(const job::Material& material) {
  const double lambda = material.lame_lambda_pa(), mu = material.lame_mu_pa();
  return {lambda, mu, material.alpha1_s * lambda, material.alpha1_s * mu, material.density_kg_m3};
}

/// In mesh coordinates. Rank 0.
mesh::TetMesh make_mesh(const job::SimulatedBody& body, std::vector<std::string>& warnings) {
  const int order = body.element == job::Element::T10 ? 2 : 1;
  mesh::TetMesh mesh;
  if (body.body) {
    run::MesherWords words;
    mesh = run::make_body_mesh(*body.body, order, {body.body->nodes, body.body->edge_m}, words);
    warnings = std::move(words.warnings);
  } else {
    mesh = mesh::read_mesh(body.mesh);
    mesh::scale_lengths(mesh, body.mesh_scale);
    warnings = std::move(mesh.remarks);
  }
  const mesh::CheckReport check = mesh::check_mesh(mesh, fmt::format("body \"{}\"", body.name));
  warnings.insert(warnings.end(), check.warnings.begin(), check.warnings.end());
  if (order == 2 && mesh.order == 1) mesh = mesh::to_quadratic(mesh);
  if (order == 1 && mesh.order == 2) mesh = mesh::to_linear(mesh);
  return mesh;
}

/// Nodes and shares of the nearest skin point. Refuses points too far from it relative to the body's extent about its centre of mass.
std::vector<transient::NodeShare> find_struck_nodes(const transient::Assembly& assembly, std::size_t body,
                                                    const std::vector<std::array<std::int32_t, 6>>& skin, const Vec3& centre_m,
                                                    const Vec3& point_m, const std::string& place) {
  double distance = 0, extent = 0;
  const transient::Assembly::Body& struck = assembly.bodies[body];
  for (std::int32_t n = struck.first_node; n < struck.last_node; ++n) extent = std::max(extent, norm(assembly.nodes_m[n] - centre_m));
  std::vector<transient::NodeShare> shares = find_shares(assembly, skin, point_m, &distance);
  if (distance > kMaxStrikeDistanceRatio * extent)
    throw InputError(fmt::format("{}: \"point_m\" is {:.3g} m from the surface of body \"{}\"; give a point on it, in the axes of its mesh",
                                 place, distance, struck.name));
  return shares;
}

std::vector<std::int32_t> find_group(const mesh::TetMesh& mesh, const job::NodeGroup& group) {
  return name_place(group.place, [&] {
    std::vector<std::int32_t> nodes = group.node_set.empty() ? mesh::find_fixed_nodes(mesh, group.box_m[0], group.box_m[1])
                                                             : mesh::find_fixed_nodes(mesh, group.node_set);
    return nodes;
  });
}

/// True if the nodes are collinear.
bool is_line(const std::vector<Vec3>& nodes_m, const std::vector<std::int32_t>& nodes) {
  const auto at = [&](std::size_t i) { return nodes_m[nodes[i]]; };
  std::size_t far = 0;
  for (std::size_t i = 1; i < nodes.size(); ++i)
    if (norm(at(i) - at(0)) > norm(at(far) - at(0))) far = i;
  const double length = norm(at(far) - at(0));
  if (!(length > 0)) return true;
  const Vec3 along = (1.0 / length) * (at(far) - at(0));
  return std::all_of(nodes.begin(), nodes.end(), [&](std::int32_t node) {
    const Vec3 way = nodes_m[node] - at(0);
    return norm(way - dot(way, along) * along) < 1e-6 * length;
  });
}

/// A body as known to rank 0. Nodes of `constrained` are mesh nodes; of a sheet vertices, then edges and ghosts.
struct Made {
  transient::AnyBody body;
  struct Group {
    std::vector<std::int32_t> nodes;
    std::vector<std::array<double, 4>> rows;  // path rows
    bool is_hinge = false;
    double release_s = std::numeric_limits<double>::infinity();
  };
  std::vector<Group> constrained;
  Vec3 centre_m{};
  std::vector<std::string> warnings = {};  // from its mesh
  std::map<std::int32_t, Vec3> moved;      // displaced nodes of a bent body; mesh coordinates
  std::vector<transient::Quad> start;      // (nodes) initial displacements of a bent body
};

/// Constrained groups of a body, each node once: driven groups one by one, then fixed, then hinged nodes.
struct ConstrainedGroups {
  std::vector<Made::Group> driven;
  std::vector<std::int32_t> fixed, hinged;
};

ConstrainedGroups find_constrained(const job::SimulatedBody& body, const mesh::TetMesh& mesh) {
  ConstrainedGroups constrained;
  std::set<std::int32_t> driven, fixed, hinged;
  for (const job::Drive& drive : body.drives) {
    Made::Group group{find_group(mesh, drive.nodes), drive.path, false};
    if (drive.release_s) group.release_s = *drive.release_s;
    for (const std::int32_t node : group.nodes)
      if (!driven.insert(node).second)
        throw InputError(fmt::format("{}: a node of this drive follows another path already; drive each node once", drive.nodes.place));
    constrained.driven.push_back(std::move(group));
  }
  for (const job::NodeGroup& group : body.fixed)
    for (const std::int32_t node : find_group(mesh, group)) {
      if (driven.contains(node))
        throw InputError(fmt::format("{}: a node that is fixed here follows a path, too; take it out of one of the two", group.place));
      fixed.insert(node);
    }
  for (const job::NodeGroup& group : body.hinged)
    for (const std::int32_t node : find_group(mesh, group)) {
      if (driven.contains(node) || fixed.contains(node))
        throw InputError(
            fmt::format("{}: a node that is hinged here is fixed or follows a path, too; take it out of one of the two", group.place));
      hinged.insert(node);
    }
  constrained.fixed.assign(fixed.begin(), fixed.end());
  constrained.hinged.assign(hinged.begin(), hinged.end());
  return constrained;
}

/// Node at the position of each row of a table.
std::vector<std::int32_t> find_table_nodes(const mesh::TetMesh& mesh, const job::Bend& bend) {
  std::vector<std::pair<double, std::int32_t>> by_x;
  Vec3 low = mesh.nodes_m[0], high = low;
  for (std::size_t n = 0; n < mesh.nodes_m.size(); ++n) {
    by_x.emplace_back(mesh.nodes_m[n][0], static_cast<std::int32_t>(n));
    for (std::size_t axis = 0; axis < 3; ++axis) {
      low[axis] = std::min(low[axis], mesh.nodes_m[n][axis]);
      high[axis] = std::max(high[axis], mesh.nodes_m[n][axis]);
    }
  }
  std::sort(by_x.begin(), by_x.end());
  const double reach = kMaxTableDistanceRatio * norm(high - low);
  std::vector<std::int32_t> nodes;
  for (std::size_t row = 0; row < bend.table.size(); ++row) {
    const Vec3 at{bend.table[row][0], bend.table[row][1], bend.table[row][2]};
    double nearest = reach;
    std::int32_t found = -1;
    for (auto i = std::lower_bound(by_x.begin(), by_x.end(), std::pair(at[0] - reach, std::int32_t{-1}));
         i != by_x.end() && i->first <= at[0] + reach; ++i)
      if (const double distance = norm(mesh.nodes_m[i->second] - at); distance <= nearest) {
        nearest = distance;
        found = i->second;
      }
    if (found < 0)
      throw InputError(fmt::format("{}: row {} of \"table_m\" is at ({:g}, {:g}, {:g}) m, where the mesh has no node", bend.place, row + 1,
                                   at[0], at[1], at[2]));
    nodes.push_back(found);
  }
  return nodes;
}

/// Displaced nodes of a bent body, in mesh coordinates.
std::map<std::int32_t, Vec3> find_moved(const job::SimulatedBody& body, const mesh::TetMesh& mesh, const ConstrainedGroups& constrained) {
  std::map<std::int32_t, Vec3> moved;
  for (const job::Bend& bend : body.bends) {
    const auto move = [&](std::int32_t node, const Vec3& by) {
      for (const auto* held : {&constrained.fixed, &constrained.hinged})
        if (norm(by) > 0.0 && std::binary_search(held->begin(), held->end(), node))
          throw InputError(fmt::format("{}: a node that is moved here is fixed or hinged; take it out of one of the two", bend.place));
      if (!moved.emplace(node, by).second)
        throw InputError(fmt::format("{}: a node is moved here for the second time; name it once", bend.place));
    };
    if (bend.nodes)
      for (const std::int32_t node : find_group(mesh, *bend.nodes)) move(node, bend.displacement_m);
    if (bend.table.empty()) continue;
    const std::vector<std::int32_t> nodes = find_table_nodes(mesh, bend);
    for (std::size_t row = 0; row < nodes.size(); ++row) move(nodes[row], {bend.table[row][3], bend.table[row][4], bend.table[row][5]});
  }
  return moved;
}

Made make_solid(const job::SimulatedBody& body) {
  Made made;
  transient::SolidBody solid;
  solid.name = body.name;
  solid.mesh = name_place(body.place, [&] { return make_mesh(body, made.warnings); });
  solid.law = make_law(body.material);
  solid.mass_damping_per_s = body.material.alpha2_per_s;
  mesh::TetMesh& mesh = solid.mesh;
  ConstrainedGroups constrained = find_constrained(body, mesh);
  made.moved = find_moved(body, mesh, constrained);
  made.constrained = std::move(constrained.driven);
  if (!constrained.fixed.empty()) {
    const bool is_hinge = body.drives.empty() && is_line(mesh.nodes_m, constrained.fixed);
    made.constrained.push_back({std::move(constrained.fixed), {}, is_hinge});
  }
  const Placement placement = find_placement(body);
  for (Vec3& x : mesh.nodes_m) x = placement.place(x);
  double volume = 0;
  for (std::int64_t e = 0; e < mesh.tet_count(); ++e) {
    const auto tet = mesh.tet(e);
    std::array<Vec3, 4> at{};
    for (std::size_t c = 0; c < 4; ++c) at[c] = mesh.nodes_m[tet[c]];
    const double v = dot(at[1] - at[0], cross(at[2] - at[0], at[3] - at[0])) / 6.0;
    volume += v;
    made.centre_m = made.centre_m + 0.25 * v * (at[0] + at[1] + at[2] + at[3]);
  }
  made.centre_m = (1.0 / volume) * made.centre_m;
  made.body = std::move(solid);
  return made;
}

/// Constrains the angles of all edges between clamped vertices, and the ghosts behind rim edges, which follow both ends of their edge.
void clamp_directions(const std::string& place, const transient::SheetElements& elements, const std::vector<std::int32_t>& group_of,
                      Made& made, std::vector<std::int32_t>& fixed_nodes) {
  const auto find_group_of = [&](std::int32_t vertex) { return group_of[vertex]; };
  for (std::size_t e = 0; e < elements.edge.size(); ++e)
    if (find_group_of(elements.edge[e][0]) >= 0 && find_group_of(elements.edge[e][1]) >= 0)
      fixed_nodes.push_back(elements.vertices + static_cast<std::int32_t>(e));
  for (const auto& nodes : elements.nodes)
    for (std::size_t i = 0; i < 3; ++i) {
      const std::int32_t ghost = nodes[3 + i];
      if (ghost < elements.vertices + elements.edges) continue;
      const std::int32_t group = find_group_of(nodes[(i + 1) % 3]);
      if (group != find_group_of(nodes[(i + 2) % 3]))
        throw InputError(
            fmt::format("{}: an edge of the rim joins two groups of constrained nodes; leave a free vertex between them", place));
      if (group < std::ssize(made.constrained))
        made.constrained[group].nodes.push_back(ghost);
      else
        fixed_nodes.push_back(ghost);
    }
}

Made make_sheet(const job::SimulatedBody& body) {
  Made made;
  const job::Sheet& described = *body.sheet;
  transient::SheetBody sheet;
  sheet.name = body.name;
  sheet.mesh = name_place(body.place, [&] {
    return described.shape == "disc" ? transient::make_disc(described.radius_m, described.cells)
                                     : transient::make_rectangle(described.length_m, described.width_m, described.cells, described.bow_m);
  });
  sheet.law = {body.material.lame_lambda_pa(), body.material.lame_mu_pa(), body.material.density_kg_m3, described.thickness_m,
               body.material.alpha1_s};
  sheet.mass_damping_per_s = body.material.alpha2_per_s;
  // Same grouping as for solids.
  mesh::TetMesh vertices;
  vertices.nodes_m = sheet.mesh.vertices_m;
  vertices.node_sets = sheet.mesh.node_sets;
  ConstrainedGroups constrained = find_constrained(body, vertices);
  made.moved = find_moved(body, vertices, constrained);
  std::vector<std::int32_t> group_of(vertices.nodes_m.size(), -1);  // clamped: group index
  sheet.clamped.resize(vertices.nodes_m.size());
  const auto clamp = [&](const std::vector<std::int32_t>& nodes, std::size_t group) {
    for (const std::int32_t node : nodes) {
      group_of[node] = static_cast<std::int32_t>(group);
      sheet.clamped[node] = true;
    }
  };
  // A released edge rotates freely: elements include the direction of permanent clamps only.
  for (std::size_t g = 0; g < constrained.driven.size(); ++g)
    if (std::isinf(constrained.driven[g].release_s)) clamp(constrained.driven[g].nodes, g);
  clamp(constrained.fixed, constrained.driven.size());
  const bool is_hinge = constrained.driven.empty() && constrained.fixed.empty() && is_line(vertices.nodes_m, constrained.hinged);
  made.constrained = std::move(constrained.driven);
  // Angles are no positions: fixed even where vertices follow a path.
  clamp_directions(body.place, transient::make_elements(sheet.mesh, sheet.clamped), group_of, made, constrained.fixed);
  if (!constrained.fixed.empty()) made.constrained.push_back({std::move(constrained.fixed), {}, false});
  if (!constrained.hinged.empty()) made.constrained.push_back({std::move(constrained.hinged), {}, is_hinge});
  const Placement placement = find_placement(body);
  for (Vec3& x : sheet.mesh.vertices_m) x = placement.place(x);
  double area = 0;
  for (const Triangle& triangle : sheet.mesh.triangles) {
    std::array<Vec3, 3> at{};
    for (std::size_t c = 0; c < 3; ++c) at[c] = sheet.mesh.vertices_m[triangle[c]];
    const double a = 0.5 * norm(cross(at[1] - at[0], at[2] - at[0]));
    area += a;
    made.centre_m = made.centre_m + (a / 3.0) * (at[0] + at[1] + at[2]);
  }
  made.centre_m = (1.0 / area) * made.centre_m;
  made.body = std::move(sheet);
  return made;
}

/// Computes the initial shape of a bent body. Rank 0.
Bent bend(const job::SimulationSpec& spec, std::size_t b, Made& made) {
  const double begin_s = base::get_process_cpu_s();
  const job::SimulatedBody& described = spec.bodies[b];
  const Placement placement = find_placement(described);
  const comm::Communicator alone(MPI_COMM_SELF);
  const auto assembly = std::make_shared<const transient::Assembly>(transient::make_assembly(alone, std::vector{made.body}));
  transient::Domain domain(alone, assembly);
  const transient::Assembly::Body& body = assembly->bodies[0];
  const auto find_number = [&](std::int32_t node) { return body.is_sheet ? node : body.node_of_mesh[node]; };
  std::map<std::int32_t, Vec3> held;
  for (const Made::Group& group : made.constrained)
    for (const std::int32_t node : group.nodes) held[find_number(node)] = {};
  for (const auto& [node, by] : made.moved) held[find_number(node)] = placement.rotation * by;
  std::vector<transient::HeldNode> held_nodes;
  for (const auto& [node, by] : held) held_nodes.push_back({node, by});
  Bent bent{.body = b};
  std::vector<transient::Quad> u;
  const job::Bend& first = described.bends.front();
  name_place(first.place, [&] {
    if (first.mode > 0) {
      transient::ElasticMode mode = transient::calc_mode(domain, held_nodes, first.mode);
      bent.mode_hz = mode.omega_rad_s / (2.0 * std::numbers::pi);
      u = std::move(mode.shape);
      const double a = first.amplitude_m;
      for (transient::Quad& q : u) q = {a * q.x, a * q.y, a * q.z, 0.0};
      return;
    }
    std::vector<transient::PulledNode> pulled;
    for (const job::Bend& one : described.bends) {
      if (!one.force_n) continue;
      const auto skin = transient::list_skin(*assembly, 0);
      for (const transient::NodeShare& share :
           find_struck_nodes(*assembly, 0, skin, made.centre_m, placement.place(one.point_m), one.place))
        pulled.push_back({share.node, share.share * (placement.rotation * *one.force_n)});
    }
    // Without a ramp, gravity acts from the start.
    if (spec.settle_s == 0.0 && norm(spec.gravity_m_s2) > 0.0)
      for (std::int32_t n = 0; n < domain.node_count(); ++n)
        if (domain.is_point(n)) pulled.push_back({n, domain.get_masses_kg()[n] * spec.gravity_m_s2});
    u = transient::calc_equilibrium(domain, held_nodes, pulled);
  });
  for (const double energy : domain.calc_state(u.data()).energy_j) bent.energy_j += energy;
  const std::size_t nodes = body.is_sheet ? u.size() : body.node_of_mesh.size();
  for (std::size_t n = 0; n < nodes; ++n) {
    const std::size_t number = find_number(static_cast<std::int32_t>(n));
    made.start.push_back(u[number]);
    if (domain.is_point(static_cast<std::int32_t>(number)))
      bent.displacement_m = std::max(bent.displacement_m, norm({u[number].x, u[number].y, u[number].z}));
  }
  bent.cpu_s = base::get_process_cpu_s() - begin_s;
  return bent;
}

std::string describe(const std::string& name, const Bent& bent) {
  return fmt::format("body \"{}\": bent by {:.4g} m{}, {:.4g} J; {:.2g} CPU s", name, bent.displacement_m,
                     bent.mode_hz > 0.0 ? fmt::format(" (mode at {:.5g} Hz)", bent.mode_hz) : "", bent.energy_j, bent.cpu_s);
}

std::string describe(const transient::AnyBody& body) {
  if (const auto* solid = std::get_if<transient::SolidBody>(&body))
    return fmt::format("body \"{}\": {} nodes, {} elements (T{})", solid->name, solid->mesh.nodes_m.size(), solid->mesh.tet_count(),
                       solid->mesh.nodes_per_tet());
  const auto& sheet = std::get<transient::SheetBody>(body);
  return fmt::format("body \"{}\": {} vertices, {} triangles (sheet)", sheet.name, sheet.mesh.vertices_m.size(),
                     sheet.mesh.triangles.size());
}

/// Displacements of bent bodies in assembly numbering, on every rank.
void share_start(const comm::Communicator& comm, const std::vector<Made>& made, Bodies& bodies) {
  bodies.start = comm.broadcast([&] {
    std::vector<transient::Quad> start;
    for (std::size_t b = 0; b < made.size(); ++b) {
      if (made[b].start.empty()) continue;
      start.resize(bodies.assembly->nodes_m.size());
      const transient::Assembly::Body& body = bodies.assembly->bodies[b];
      for (std::size_t n = 0; n < made[b].start.size(); ++n)
        start[body.is_sheet ? body.first_node + static_cast<std::int32_t>(n) : body.node_of_mesh[n]] = made[b].start[n];
    }
    return start;
  });
}

/// Broadcasts lists of rank 0.
void share(const comm::Communicator& comm, const std::vector<Made>& made, const transient::Assembly& assembly, Bodies& bodies) {
  struct Entry {
    std::int32_t constraint, node;
  };
  struct Row {
    std::int32_t constraint;
    double at[4];
  };
  struct Kind {
    std::int32_t is_hinge;
    double release_s;
  };
  std::vector<Entry> entries;
  std::vector<Row> rows;
  std::vector<Kind> kinds;
  if (comm.is_root())
    for (std::size_t b = 0; b < made.size(); ++b)
      for (const Made::Group& constrained : made[b].constrained) {
        const auto constraint = static_cast<std::int32_t>(kinds.size());
        const transient::Assembly::Body& body = assembly.bodies[b];
        for (const std::int32_t node : constrained.nodes)
          entries.push_back({constraint, body.is_sheet ? body.first_node + node : body.node_of_mesh[node]});
        for (const auto& row : constrained.rows) rows.push_back({constraint, {row[0], row[1], row[2], row[3]}});
        kinds.push_back({constrained.is_hinge ? 1 : 0, constrained.release_s});
      }
  entries = comm.broadcast(std::move(entries));
  rows = comm.broadcast(std::move(rows));
  kinds = comm.broadcast(std::move(kinds));
  bodies.constraints.resize(kinds.size());
  std::vector<std::vector<transient::PathRow>> paths(kinds.size());
  for (const Entry& entry : entries) bodies.constraints[entry.constraint].nodes.push_back(entry.node);
  for (const Row& row : rows) paths[row.constraint].push_back({row.at[0], {row.at[1], row.at[2], row.at[3]}});
  for (std::size_t h = 0; h < kinds.size(); ++h) {
    if (!paths[h].empty()) bodies.constraints[h].path = transient::Path(std::move(paths[h]));
    bodies.constraints[h].is_hinge = kinds[h].is_hinge != 0;
    bodies.constraints[h].release_s = kinds[h].release_s;
  }
}

void add_blows(const job::SimulationSpec& spec, Bodies& bodies) {
  const transient::Assembly& assembly = *bodies.assembly;
  std::map<std::size_t, std::vector<std::array<std::int32_t, 6>>> skins;
  for (const job::Blow& blow : spec.blows) {
    const auto [skin, is_new] = skins.try_emplace(blow.body);
    if (is_new) skin->second = transient::list_skin(assembly, static_cast<std::int32_t>(blow.body));
    const Placement placement = find_placement(spec.bodies[blow.body]);
    transient::Impulse impulse;
    impulse.time_s = blow.time_s - 0.5 * blow.duration_s;
    impulse.duration_s = blow.duration_s;
    impulse.impulse_n_s = placement.rotation * blow.impulse_n_s;
    impulse.shares =
        find_struck_nodes(assembly, blow.body, skin->second, bodies.centre_m[blow.body], placement.place(blow.point_m), blow.place);
    bodies.impulses.push_back(std::move(impulse));
  }
}

}  // namespace

Placement find_placement(const job::SimulatedBody& body) {
  Mat3 total{Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double angle = body.rotation_deg[axis] * std::numbers::pi / 180.0, c = std::cos(angle), s = std::sin(angle);
    Mat3 turn{Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}};
    const std::size_t j = (axis + 1) % 3, k = (axis + 2) % 3;
    turn[j][j] = turn[k][k] = c;
    turn[j][k] = -s;
    turn[k][j] = s;
    total = turn * total;
  }
  return {total, body.position_m};
}

Bodies make_bodies(const comm::Communicator& comm, const job::SimulationSpec& spec, const std::function<void(const std::string&)>& report) {
  std::vector<Made> made(spec.bodies.size());
  std::vector<Bent> bent;
  comm.agree([&] {
    if (!comm.is_root()) return;
    for (std::size_t b = 0; b < spec.bodies.size(); ++b) {
      made[b] = spec.bodies[b].sheet ? make_sheet(spec.bodies[b]) : make_solid(spec.bodies[b]);
      report(describe(made[b].body));
      if (spec.bodies[b].bends.empty()) continue;
      bent.push_back(bend(spec, b, made[b]));
      report(describe(spec.bodies[b].name, bent.back()));
    }
  });
  std::vector<transient::AnyBody> moving;
  std::vector<Vec3> centres;
  Bodies bodies;
  for (std::size_t b = 0; b < made.size(); ++b)
    for (const std::string& warning : made[b].warnings)
      bodies.warnings.push_back(fmt::format("body \"{}\": {}", spec.bodies[b].name, warning));
  for (Made& one : made) {
    moving.push_back(std::move(one.body));
    centres.push_back(one.centre_m);
  }
  bodies.assembly = std::make_shared<const transient::Assembly>(transient::make_assembly(comm, moving));
  bodies.centre_m = comm.broadcast(std::move(centres));
  bodies.bent = std::move(bent);
  share(comm, made, *bodies.assembly, bodies);
  share_start(comm, made, bodies);
  comm.agree([&] { add_blows(spec, bodies); });
  return bodies;
}

std::vector<std::array<std::int32_t, 3>> list_skin_triangles(const transient::Assembly& assembly, std::int32_t body) {
  std::vector<std::array<std::int32_t, 3>> triangles;
  for (const auto& [a, b, c, ab, bc, ca] : transient::list_skin(assembly, body)) {
    if (ab < 0) {
      triangles.push_back({a, b, c});
    } else {
      triangles.push_back({a, ab, ca});
      triangles.push_back({ab, b, bc});
      triangles.push_back({ca, bc, c});
      triangles.push_back({ab, bc, ca});
    }
  }
  return triangles;
}

transient::TouchSurface make_touch_surface(const transient::Assembly& assembly, const job::SimulationSpec& spec) {
  std::vector<std::array<std::int32_t, 3>> triangles;
  std::vector<std::int32_t> body_of_triangle;
  std::vector<double> modulus, reach;
  for (std::size_t b = 0; b < assembly.bodies.size(); ++b) {
    const auto own = list_skin_triangles(assembly, static_cast<std::int32_t>(b));
    triangles.insert(triangles.end(), own.begin(), own.end());
    body_of_triangle.insert(body_of_triangle.end(), own.size(), static_cast<std::int32_t>(b));
    const job::Material& material = spec.bodies[b].material;
    modulus.push_back(material.young_modulus_pa / (1.0 - material.poisson_ratio * material.poisson_ratio));
    reach.push_back(spec.bodies[b].sheet ? 0.5 * spec.bodies[b].sheet->thickness_m : 0.0);
  }
  return transient::make_touch_surface(assembly.nodes_m, triangles, body_of_triangle, modulus, reach, spec.contact.stiffness);
}

}  // namespace carillon::simulation
