// Calls of the C interface: opaque handles to C++ classes; exceptions become a status and a message.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstring>
#include <exception>
#include <memory>
#include <mutex>
#include <new>
#include <optional>
#include <string_view>
#include <utility>

#include "runtime/bank/bank.hpp"
#include "runtime/bank/nearest.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/vector.hpp"
#include "runtime/bindings/c_api/carillon.h"
#include "runtime/events/events.hpp"
#include "runtime/synth/load_keeper.hpp"
#include "runtime/synth/model.hpp"
#include "runtime/synth/synthesiser.hpp"

struct carillon_bank {
  explicit carillon_bank(carillon::bank::Bank given) : bank(std::move(given)) {}
  carillon::bank::Bank bank;

  /// Created by the first call. Throws std::bad_alloc.
  const carillon::bank::SurfaceTree& get_tree() const {
    const carillon::bank::SurfaceTree* made = ready.load(std::memory_order_acquire);
    if (made != nullptr) return *made;
    const std::lock_guard lock(making);
    if (!tree) tree.emplace(bank);
    ready.store(&*tree, std::memory_order_release);
    return *tree;
  }

 private:
  mutable std::mutex making;
  mutable std::optional<carillon::bank::SurfaceTree> tree;
  mutable std::atomic<const carillon::bank::SurfaceTree*> ready{nullptr};
};
struct carillon_model {
  std::shared_ptr<const carillon::synth::Model> model;
};
struct carillon_synth {
  explicit carillon_synth(carillon::synth::SynthesiserOptions options) : synthesiser(std::move(options)) {}
  carillon::synth::Synthesiser synthesiser;
  carillon::synth::LoadKeeper load;
};

namespace carillon::c_api {

inline void write_message(std::string_view text, char* message, size_t message_size) {
  if (message == nullptr || message_size == 0) return;
  const std::size_t length = std::min(text.size(), message_size - 1);
  std::memcpy(message, text.data(), length);
  message[length] = '\0';
}

/// Runs `work` and translates exceptions to status and message.
template <typename Work>
carillon_status run(char* message, size_t message_size, Work&& work) noexcept {
  try {
    work();
    write_message("", message, message_size);
    return CARILLON_OK;
  } catch (const InputError& error) {
    write_message(error.what(), message, message_size);
    return CARILLON_BAD_INPUT;
  } catch (const std::bad_alloc&) {
    write_message("out of memory", message, message_size);
  } catch (const std::exception& error) {
    write_message(error.what(), message, message_size);
  } catch (...) {
    write_message("unknown error", message, message_size);
  }
  return CARILLON_SYSTEM;
}

inline carillon_status refuse(const char* text, char* message, size_t message_size) {
  write_message(text, message, message_size);
  return CARILLON_BAD_ARGUMENT;
}

inline Vec3 to_vector(const double* x) { return {x[0], x[1], x[2]}; }
inline events::Quaternion to_quaternion(const double* x) { return {x[0], x[1], x[2], x[3]}; }

}  // namespace carillon::c_api
