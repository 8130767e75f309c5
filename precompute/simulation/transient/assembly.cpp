// Method: rank 0 sorts nodes along a Morton curve and elements by kind and lowest node, and broadcasts the result. Consecutive nodes are
//   close in space, so an element's node values share few cache lines.
// Source: Morton 1966.
#include "precompute/simulation/transient/assembly.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <tuple>

#include "runtime/base/error.hpp"

namespace carillon::transient {
namespace {

std::uint64_t spread_bits(std::uint64_t v) {
  v &= 0x1fffff;
  v = (v | v << 32) & 0x1f00000000ffff;
  v = (v | v << 16) & 0x1f0000ff0000ff;
  v = (v | v << 8) & 0x100f00f00f00f00f;
  v = (v | v << 4) & 0x10c30c30c30c30c3;
  return (v | v << 2) & 0x1249249249249249;
}

/// Nodes along a Morton curve: result[i] is the old number of new node i.
std::vector<std::int32_t> sort_nodes(const std::vector<Vec3>& nodes_m) {
  Vec3 low{1e300, 1e300, 1e300}, high{-1e300, -1e300, -1e300};
  for (const Vec3& x : nodes_m)
    for (std::size_t i = 0; i < 3; ++i) {
      low[i] = std::min(low[i], x[i]);
      high[i] = std::max(high[i], x[i]);
    }
  const double extent = std::max({high[0] - low[0], high[1] - low[1], high[2] - low[2], 1e-300});
  std::vector<std::uint64_t> key(nodes_m.size());
  for (std::size_t n = 0; n < nodes_m.size(); ++n)
    for (std::size_t i = 0; i < 3; ++i)
      key[n] |= spread_bits(static_cast<std::uint64_t>(2097151.0 * ((nodes_m[n][i] - low[i]) / extent))) << i;
  std::vector<std::int32_t> order(nodes_m.size());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](std::int32_t a, std::int32_t b) { return std::tuple(key[a], a) < std::tuple(key[b], b); });
  return order;
}

void check_law(const SolidBody& body) {
  const Law& law = body.law;
  const bool ok = law.mu_pa > 0.0 && law.density_kg_m3 > 0.0 && 3.0 * law.lambda_pa + 2.0 * law.mu_pa > 0.0 && law.psi_pa_s >= 0.0 &&
                  3.0 * law.phi_pa_s + 2.0 * law.psi_pa_s >= 0.0 && body.mass_damping_per_s >= 0.0 &&
                  std::isfinite(law.lambda_pa + law.mu_pa + law.phi_pa_s + law.psi_pa_s + law.density_kg_m3 + body.mass_damping_per_s);
  if (ok) return;
  throw InputError(
      fmt::format("body '{}': lambda {} Pa, mu {} Pa, phi {} Pa s, psi {} Pa s, density {} kg/m^3, mass damping {} 1/s are no solid; mu, 3 "
                  "lambda + 2 mu "
                  "and the density must be positive, damping must not be negative",
                  body.name, law.lambda_pa, law.mu_pa, law.phi_pa_s, law.psi_pa_s, law.density_kg_m3, body.mass_damping_per_s));
}

/// Broadcast data of a body, except its texts.
struct Numbers {
  Law law;
  double mass_damping_per_s;
  std::int32_t nodes, elements, straight, width, mesh_nodes;
};

/// Broadcast data of a sheet.
struct SheetNumbers {
  SheetLaw law;
  std::int32_t body, vertices, triangles;
};

void check_sheet(const SheetBody& sheet) {
  const SheetLaw& law = sheet.law;
  if (law.mu_pa > 0.0 && law.density_kg_m3 > 0.0 && 3.0 * law.lambda_pa + 2.0 * law.mu_pa > 0.0 && law.alpha1_s >= 0.0 &&
      law.thickness_m > 0.0 && sheet.mass_damping_per_s >= 0.0 &&
      std::isfinite(law.mu_pa + law.lambda_pa + law.density_kg_m3 + law.thickness_m + law.alpha1_s + sheet.mass_damping_per_s))
    return;
  throw InputError(
      fmt::format("body '{}': its material or thickness is that of no sheet; moduli, density and thickness must be positive, damping must "
                  "not be negative",
                  sheet.name));
}

/// Appends a body; on rank 0.
void append_body(const SolidBody& solid, Assembly& assembly, std::vector<Numbers>& numbers, std::vector<std::int32_t>& node_of_mesh) {
  check_law(solid);
  const mesh::TetMesh& mesh = solid.mesh;
  const std::size_t width = mesh.nodes_per_tet(), elements = mesh.tet_count();
  if (elements == 0) throw InputError(fmt::format("body '{}' has no elements", solid.name));
  const std::int32_t first_node = assembly.node_count();
  const std::vector<std::int32_t> order = sort_nodes(mesh.nodes_m);
  std::vector<std::int32_t> number(order.size());
  for (std::size_t i = 0; i < order.size(); ++i) {
    number[order[i]] = first_node + static_cast<std::int32_t>(i);
    assembly.nodes_m.push_back(mesh.nodes_m[order[i]]);
  }
  struct Key {
    bool curved;
    std::array<std::int32_t, 10> sorted;
    std::int32_t element;
    bool operator<(const Key& other) const {
      return std::tie(curved, sorted, element) < std::tie(other.curved, other.sorted, other.element);
    }
  };
  std::vector<Key> keys;
  std::int32_t straight = 0;
  for (std::size_t e = 0; e < elements; ++e) {
    Key key{false, {}, static_cast<std::int32_t>(e)};
    key.sorted.fill(std::numeric_limits<std::int32_t>::max());
    std::array<Vec3, 10> x{};
    for (std::size_t a = 0; a < width; ++a) {
      const std::size_t node = mesh.tets[e * width + a];
      key.sorted[a] = number[node];
      x[a] = mesh.nodes_m[node];
    }
    key.curved = width == 10 && is_curved(x);
    ElementShape shape;
    const Kind kind = width == 4 ? Kind::kT4 : key.curved ? Kind::kCurvedT10 : Kind::kT10;
    if (!make_shape(kind, std::span(x.data(), width), shape))
      throw InputError(
          fmt::format("body '{}': element {} of its mesh, at ({:.4g}, {:.4g}, {:.4g}) m, is inside out or folded over; repair the mesh",
                      solid.name, e + 1, x[0][0], x[0][1], x[0][2]));
    straight += key.curved ? 0 : 1;
    std::sort(key.sorted.begin(), key.sorted.end());
    keys.push_back(key);
  }
  std::sort(keys.begin(), keys.end());
  for (const Key& key : keys) {
    for (std::size_t a = 0; a < width; ++a) assembly.tets.push_back(number[mesh.tets[static_cast<std::size_t>(key.element) * width + a]]);
    assembly.element_of_mesh.push_back(key.element);
  }
  node_of_mesh.insert(node_of_mesh.end(), number.begin(), number.end());
  numbers.push_back({solid.law, solid.mass_damping_per_s, static_cast<std::int32_t>(order.size()), static_cast<std::int32_t>(elements),
                     straight, static_cast<std::int32_t>(width), static_cast<std::int32_t>(number.size())});
}

/// Assembly on rank 0, in arrays for the broadcast.
struct Draft {
  Assembly assembly;
  std::vector<Numbers> numbers;  // (bodies)
  std::vector<std::string> names;
  std::vector<std::int32_t> node_of_mesh;  // of all bodies
  std::vector<SheetNumbers> sheets;
  std::vector<Vec3> vertices_m;       // of all sheets
  std::vector<std::int32_t> corners;  // (triangles of all sheets, 3)
  std::vector<char> clamped;          // (vertices of all sheets)
};

void append_sheet(const SheetBody& sheet, Draft& draft) {
  check_sheet(sheet);
  if (sheet.mesh.triangles.empty()) throw InputError(fmt::format("body '{}' has no triangles", sheet.name));
  Assembly& assembly = draft.assembly;
  const double alpha1 = sheet.law.alpha1_s;
  const SheetElements elements = make_elements(sheet.mesh, sheet.clamped);
  const std::int32_t first = assembly.node_count();
  for (const Vec3& x : elements.rest_m) assembly.nodes_m.push_back(x);
  for (std::size_t t = 0; t < elements.nodes.size(); ++t) {
    for (const std::int32_t node : elements.nodes[t]) assembly.tets.push_back(node < 0 ? -1 : first + node);
    assembly.element_of_mesh.push_back(static_cast<std::int32_t>(t));
  }
  for (std::int32_t n = 0; n < elements.vertices; ++n) draft.node_of_mesh.push_back(first + n);
  const auto triangles = static_cast<std::int32_t>(elements.nodes.size());
  draft.numbers.push_back(
      {{sheet.law.lambda_pa, sheet.law.mu_pa, alpha1 * sheet.law.lambda_pa, alpha1 * sheet.law.mu_pa, sheet.law.density_kg_m3},
       sheet.mass_damping_per_s,
       elements.count_nodes(),
       triangles,
       triangles,
       9,
       elements.vertices});
  draft.sheets.push_back({sheet.law, static_cast<std::int32_t>(draft.names.size()), elements.vertices, triangles});
  draft.vertices_m.insert(draft.vertices_m.end(), sheet.mesh.vertices_m.begin(), sheet.mesh.vertices_m.end());
  for (const Triangle& triangle : sheet.mesh.triangles) draft.corners.insert(draft.corners.end(), triangle.begin(), triangle.end());
  for (const bool is_clamped : sheet.clamped) draft.clamped.push_back(is_clamped ? 1 : 0);
  draft.names.push_back(sheet.name);
}

/// Broadcast from rank 0. Collective.
void broadcast(const comm::Communicator& comm, Draft& draft) {
  const auto share = [&](auto& values) { values = comm.broadcast(std::move(values)); };
  share(draft.names);
  share(draft.sheets);
  share(draft.vertices_m);
  share(draft.corners);
  share(draft.clamped);
  share(draft.numbers);
  share(draft.node_of_mesh);
  share(draft.assembly.nodes_m);
  share(draft.assembly.tets);
  share(draft.assembly.element_of_mesh);
}

void fill_bodies(Draft& draft) {
  std::int32_t node = 0, element = 0;
  std::size_t at = 0;
  auto of_mesh = draft.node_of_mesh.begin();
  for (std::size_t b = 0; b < draft.numbers.size(); ++b) {
    const Numbers& n = draft.numbers[b];
    Assembly::Body body{draft.names[b],
                        n.law,
                        n.mass_damping_per_s,
                        node,
                        node + n.nodes,
                        element,
                        element + n.elements,
                        element + n.straight,
                        at,
                        n.width,
                        {},
                        false,
                        {},
                        {}};
    body.node_of_mesh.assign(of_mesh, of_mesh + n.mesh_nodes);
    of_mesh += n.mesh_nodes;
    node += n.nodes;
    element += n.elements;
    at += static_cast<std::size_t>(n.elements) * static_cast<std::size_t>(n.width);
    draft.assembly.bodies.push_back(std::move(body));
  }
}

void fill_sheets(Draft& draft) {
  std::size_t vertex = 0, corner = 0;
  for (const SheetNumbers& sheet : draft.sheets) {
    SheetMesh mesh;
    std::vector<bool> is_clamped;
    for (std::int32_t v = 0; v < sheet.vertices; ++v, ++vertex) {
      mesh.vertices_m.push_back(draft.vertices_m[vertex]);
      is_clamped.push_back(draft.clamped[vertex] != 0);
    }
    for (std::int32_t t = 0; t < sheet.triangles; ++t, corner += 3)
      mesh.triangles.push_back({draft.corners[corner], draft.corners[corner + 1], draft.corners[corner + 2]});
    Assembly::Body& body = draft.assembly.bodies[sheet.body];
    body.is_sheet = true;
    body.sheet = make_elements(mesh, is_clamped);
    body.sheet_law = sheet.law;
  }
}

}  // namespace

std::int32_t Assembly::find_body_of_node(std::int32_t node) const {
  const auto at = std::upper_bound(bodies.begin(), bodies.end(), node, [](std::int32_t n, const Body& body) { return n < body.last_node; });
  return static_cast<std::int32_t>(at - bodies.begin());
}

std::int32_t Assembly::find_body(std::int32_t element) const {
  const auto at =
      std::upper_bound(bodies.begin(), bodies.end(), element, [](std::int32_t e, const Body& body) { return e < body.last_element; });
  return static_cast<std::int32_t>(at - bodies.begin());
}

Kind Assembly::find_kind(std::int32_t element) const {
  const Body& body = bodies[find_body(element)];
  return body.is_sheet ? Kind::kSheet : body.width == 4 ? Kind::kT4 : element < body.first_curved ? Kind::kT10 : Kind::kCurvedT10;
}

std::span<const std::int32_t> Assembly::find_nodes(std::int32_t element) const {
  const Body& body = bodies[find_body(element)];
  const std::size_t width = body.width;
  return {tets.data() + body.nodes_at + static_cast<std::size_t>(element - body.first_element) * width, width};
}

std::string Assembly::describe(std::int32_t element) const {
  Vec3 centre{};
  const auto nodes = find_nodes(element);
  const std::size_t corners = find_kind(element) == Kind::kSheet ? 3 : 4;
  for (std::size_t a = 0; a < corners; ++a) centre = centre + 1.0 / static_cast<double>(corners) * nodes_m[nodes[a]];
  return fmt::format("body '{}', element {} of its mesh, whose centre is at rest at ({:.4g}, {:.4g}, {:.4g}) m",
                     bodies[find_body(element)].name, element_of_mesh[element] + 1, centre[0], centre[1], centre[2]);
}

bool Assembly::is_point(std::int32_t node) const {
  const Body& body = bodies[find_body_of_node(node)];
  return !body.is_sheet || node - body.first_node < body.sheet.vertices;
}

Assembly make_assembly(const comm::Communicator& comm, const std::vector<SolidBody>& bodies) {
  return make_assembly(comm, std::vector<AnyBody>(bodies.begin(), bodies.end()));
}

Assembly make_assembly(const comm::Communicator& comm, const std::vector<AnyBody>& bodies) {
  Draft draft;
  comm.agree([&] {
    if (!comm.is_root()) return;
    if (bodies.empty()) throw InputError("the job has no body");
    for (const AnyBody& body : bodies) {
      if (const auto* solid = std::get_if<SolidBody>(&body)) {
        append_body(*solid, draft.assembly, draft.numbers, draft.node_of_mesh);
        draft.names.push_back(solid->name);
      } else {
        append_sheet(std::get<SheetBody>(body), draft);
      }
    }
  });
  broadcast(comm, draft);
  comm.agree([&] {
    fill_bodies(draft);
    fill_sheets(draft);
  });
  return std::move(draft.assembly);
}

std::vector<std::array<std::int32_t, 6>> list_skin(const Assembly& assembly, std::int32_t body_number) {
  const Assembly::Body& body = assembly.bodies[body_number];
  if (body.is_sheet) {
    std::vector<std::array<std::int32_t, 6>> triangles;
    for (std::int32_t e = body.first_element; e < body.last_element; ++e) {
      const auto nodes = assembly.find_nodes(e);
      triangles.push_back({nodes[0], nodes[1], nodes[2], -1, -1, -1});
    }
    return triangles;
  }
  // Mid nodes by local corners, as in kernel.cpp.
  constexpr int kMiddle[4][4] = {{0, 4, 6, 7}, {4, 1, 5, 8}, {6, 5, 2, 9}, {7, 8, 9, 3}};
  struct Facet {
    std::array<std::int32_t, 3> key;
    std::int64_t place;  // element and face, in order
    std::array<std::int32_t, 6> nodes;
  };
  std::vector<Facet> facets;
  for (std::int32_t e = body.first_element; e < body.last_element; ++e) {
    const auto nodes = assembly.find_nodes(e);
    for (std::size_t face = 0; face < 4; ++face) {
      Facet facet{{}, std::int64_t{4} * e + static_cast<std::int64_t>(face), {}};
      for (std::size_t i = 0; i < 3; ++i) {
        const int corner = mesh::kFaces[face][i], next = mesh::kFaces[face][(i + 1) % 3];
        facet.nodes[i] = facet.key[i] = nodes[corner];
        facet.nodes[3 + i] = body.width == 4 ? -1 : nodes[kMiddle[corner][next]];
      }
      std::sort(facet.key.begin(), facet.key.end());
      facets.push_back(facet);
    }
  }
  std::sort(facets.begin(), facets.end(),
            [](const Facet& a, const Facet& b) { return std::tie(a.key, a.place) < std::tie(b.key, b.place); });
  std::vector<Facet> outer;
  for (std::size_t i = 0; i < facets.size();) {
    std::size_t next = i + 1;
    while (next < facets.size() && facets[next].key == facets[i].key) ++next;
    if (next == i + 1) outer.push_back(facets[i]);
    i = next;
  }
  std::sort(outer.begin(), outer.end(), [](const Facet& a, const Facet& b) { return a.place < b.place; });
  std::vector<std::array<std::int32_t, 6>> skin;
  for (const Facet& facet : outer) skin.push_back(facet.nodes);
  return skin;
}

std::vector<NodeShare> find_shares(const Assembly& assembly, std::int32_t body, const Vec3& point_m, double* distance_m) {
  return find_shares(assembly, list_skin(assembly, body), point_m, distance_m);
}

std::vector<NodeShare> find_shares(const Assembly& assembly, std::span<const std::array<std::int32_t, 6>> skin, const Vec3& point_m,
                                   double* distance_m) {
  const auto at = [&](std::int32_t node) { return assembly.nodes_m[node]; };
  double least = std::numeric_limits<double>::infinity();
  std::array<std::int32_t, 6> nearest{};
  Vec3 weight{};
  for (const auto& facet : skin) {
    const Vec3 a = at(facet[0]), b = at(facet[1]), c = at(facet[2]), w = weigh_corners(point_m, a, b, c);
    const double distance = norm(w[0] * a + w[1] * b + w[2] * c - point_m);
    if (distance < least) {
      least = distance;
      nearest = facet;
      weight = w;
    }
  }
  if (distance_m != nullptr) *distance_m = least;
  std::vector<NodeShare> shares;
  for (std::size_t i = 0; i < 3; ++i) {
    const bool linear = nearest[3] < 0;
    shares.push_back({nearest[i], linear ? weight[i] : weight[i] * (2.0 * weight[i] - 1.0)});
    if (!linear) shares.push_back({nearest[3 + i], 4.0 * weight[i] * weight[(i + 1) % 3]});
  }
  std::erase_if(shares, [](const NodeShare& one) { return one.share == 0.0; });
  return shares;
}

}  // namespace carillon::transient
