// The HDF5 side of a bank file, made in memory. Internal to carillon::bank; its .cpp is the only one that sees hdf5.h.
#pragma once

#include <cstddef>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "runtime/bank/bank.hpp"
#include "runtime/bank/layout.hpp"
#include "runtime/bank/seal.hpp"

namespace carillon::bank {

/// An HDF5 file in memory, and where each array of list_fields() lies in it.
struct Hdf5Image {
  std::unique_ptr<void, void (*)(void*)> memory{nullptr, nullptr};
  std::span<std::byte> bytes;  // the file as it will lie on disk; its first kSealBytes wait for the seal
  std::map<std::string, Extent> extents;
};

/// Lays the arrays, and of a bank that is not packed the /VTKHDF views, out as an HDF5 file. Not thread-safe (HDF5 is not). SystemError
/// when HDF5 or memory fails.
Hdf5Image make_hdf5_image(const Bank& bank, const FileForm& form);

}  // namespace carillon::bank
