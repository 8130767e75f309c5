// Source:     PKWARE, APPNOTE.TXT 6.3.10 (ZIP), sections 4.3.7, 4.3.12 and 4.3.16; NumPy, numpy.lib.format, version 1.0.
#include "runtime/render/npz.hpp"

#include <libdeflate.h>

#include <utility>

#include "runtime/base/error.hpp"

namespace carillon::render {
namespace {

constexpr unsigned kVersion = 20, kFirstDate = 0x21;  // 1 January 1980: the same arrays give the same bytes

/// Appends little-endian bytes.
void append(std::string& to, std::uint64_t value, int count) {
  for (int i = 0; i < count; ++i) to += static_cast<char>(value >> (8 * i) & 0xff);
}

std::string make_header(const std::string& type, const std::vector<std::size_t>& shape) {
  std::string sizes;
  for (const std::size_t size : shape) sizes += std::to_string(size) + ",";
  std::string text = "{'descr': '" + type + "', 'fortran_order': False, 'shape': (" + sizes + "), }";
  constexpr std::size_t kBefore = 10, kAligned = 64;
  text.append(kAligned - 1 - (kBefore + text.size()) % kAligned, ' ');
  text += '\n';
  std::string header("\x93NUMPY\x01\x00", 8);
  append(header, text.size(), 2);
  return header + text;
}

}  // namespace

void NpzWriter::put(std::string_view bytes) {
  sink_(bytes);
  written_ += bytes.size();
}

void NpzWriter::add(const std::string& name, const std::string& type, const std::vector<std::size_t>& shape, std::string_view bytes) {
  const std::string header = make_header(type, shape), file = name + ".npy";
  const std::uint64_t size = header.size() + bytes.size();
  if (written_ + size + directory_.size() >= 0xf0000000U) throw InputError("the labels are too large for .npz; write .jsonl instead");
  std::uint32_t crc = libdeflate_crc32(0, header.data(), header.size());
  if (!bytes.empty()) crc = libdeflate_crc32(crc, bytes.data(), bytes.size());  // it restarts at a null pointer
  std::string fields;
  for (const auto& [value, count] : {std::pair<std::uint64_t, int>{kVersion, 2},
                                     {0, 2},
                                     {0, 2},
                                     {0, 2},
                                     {kFirstDate, 2},
                                     {crc, 4},
                                     {size, 4},
                                     {size, 4},
                                     {file.size(), 2},
                                     {0, 2}})
    append(fields, value, count);
  directory_ += "PK\x01\x02";
  append(directory_, kVersion, 2);
  directory_ += fields;
  directory_.append(10, '\0');  // comment, disk, attributes
  append(directory_, written_, 4);
  directory_ += file;
  ++files_;
  put("PK\x03\x04" + fields + file + header);
  put(bytes);
}

void NpzWriter::finish() {
  const std::uint64_t size = directory_.size(), begin = written_;
  put(directory_);
  std::string end = "PK\x05\x06";
  append(end, 0, 4);
  append(end, files_, 2);
  append(end, files_, 2);
  append(end, size, 4);
  append(end, begin, 4);
  append(end, 0, 2);
  put(end);
}

}  // namespace carillon::render
