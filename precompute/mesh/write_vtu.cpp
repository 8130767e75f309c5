// Method: raw appended data in the byte order of the machine. A node set is a point array of 0 and 1, a region a value of the cell array
//   "region", both as read_mesh reads them.
// Source: VTK file formats, "XML file formats", UnstructuredGrid.

#include <fmt/format.h>

#include <bit>
#include <iterator>
#include <numeric>

#include "precompute/mesh/write.hpp"
#include "runtime/base/file.hpp"

namespace carillon::mesh {

namespace {

constexpr std::uint8_t kLinearTet = 10, kQuadraticTet = 24;

std::string escape(const std::string& name) {
  std::string text;
  for (const char c : name) {
    if (c == '&') {
      text += "&amp;";
    } else if (c == '<') {
      text += "&lt;";
    } else if (c == '"') {
      text += "&quot;";
    } else {
      text += static_cast<unsigned char>(c) < 32 ? '_' : c;
    }
  }
  return text;
}

/// Elements of the XML text, and the data that they refer to.
class VtuWriter {
 public:
  void open(const char* element) { head_ += fmt::format("<{}>\n", element); }
  void close(const char* element) { head_ += fmt::format("</{}>\n", element); }

  template <class T>
  void add(const char* type, const std::string& name, int components, const T* values, std::size_t count) {
    head_ += fmt::format("<DataArray type=\"{}\" Name=\"{}\" NumberOfComponents=\"{}\" format=\"appended\" offset=\"{}\"/>\n", type,
                         escape(name), components, data_.size());
    const std::uint64_t bytes = count * sizeof(T);
    data_.append(reinterpret_cast<const char*>(&bytes), sizeof bytes);
    data_.append(reinterpret_cast<const char*>(values), bytes);
  }

  std::string join(std::size_t points, std::size_t cells) const {
    constexpr const char* kOrder = std::endian::native == std::endian::little ? "LittleEndian" : "BigEndian";
    std::string text = fmt::format(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"{}\" header_type=\"UInt64\">\n"
        "<UnstructuredGrid>\n<Piece NumberOfPoints=\"{}\" NumberOfCells=\"{}\">\n",
        kOrder, points, cells);
    text.reserve(text.size() + head_.size() + data_.size() + 200);
    text += head_;
    text += "</Piece>\n</UnstructuredGrid>\n<AppendedData encoding=\"raw\">\n_";
    text += data_;
    text += "\n</AppendedData>\n</VTKFile>\n";
    return text;
  }

 private:
  std::string head_, data_;
};

}  // namespace

std::string make_vtu(const TetMesh& mesh) {
  const std::size_t points = mesh.nodes_m.size(), cells = mesh.tet_count();
  VtuWriter out;
  out.open("PointData");
  for (const auto& [name, nodes] : mesh.node_sets) {
    std::vector<std::uint8_t> is_in(points, 0);
    for (const std::int32_t node : nodes) is_in[node] = 1;
    out.add("UInt8", name, 1, is_in.data(), points);
  }
  if (!mesh.doubt_m.empty()) out.add("Float64", kDoubtName, 3, mesh.doubt_m.front().data(), 3 * points);
  out.close("PointData");
  std::vector<std::int32_t> regions = mesh.regions;
  regions.resize(cells, 0);
  out.open("CellData");
  out.add("Int32", "region", 1, regions.data(), cells);
  out.close("CellData");
  out.open("Points");
  out.add("Float64", "Points", 3, points > 0 ? mesh.nodes_m.front().data() : nullptr, 3 * points);
  out.close("Points");
  out.open("Cells");
  out.add("Int32", "connectivity", 1, mesh.tets.data(), mesh.tets.size());
  std::vector<std::int64_t> ends(cells, mesh.nodes_per_tet());
  std::partial_sum(ends.begin(), ends.end(), ends.begin());
  out.add("Int64", "offsets", 1, ends.data(), cells);
  const std::vector<std::uint8_t> types(cells, mesh.order == 1 ? kLinearTet : kQuadraticTet);
  out.add("UInt8", "types", 1, types.data(), cells);
  out.close("Cells");
  return out.join(points, cells);
}

void write_vtu(const TetMesh& mesh, const std::filesystem::path& file) { base::write_file(file, make_vtu(mesh)); }

}  // namespace carillon::mesh
