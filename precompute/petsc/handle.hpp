// Owners of PETSc and SLEPc objects: move-only, destroyed with the scope.
#pragma once

#include <slepceps.h>

#include <utility>

namespace carillon::petsc {

/// Owns one reference to a PETSc object. Destruction is collective, as in PETSc: destroy handles in the same order on every rank, and
/// before the Session. Converts to the plain handle for calls; out() returns the address for MatCreate and similar calls.
template <typename T, PetscErrorCode (*destroy)(T*)>
class Handle {
 public:
  Handle() = default;
  explicit Handle(T object) : object_(object) {}
  Handle(Handle&& other) noexcept : object_(std::exchange(other.object_, nullptr)) {}
  Handle& operator=(Handle&& other) noexcept {
    if (this != &other) {
      reset();
      object_ = std::exchange(other.object_, nullptr);
    }
    return *this;
  }
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;
  ~Handle() { reset(); }

  operator T() const { return object_; }
  T get() const { return object_; }
  T* out() {
    reset();
    return &object_;
  }
  T release() { return std::exchange(object_, nullptr); }
  void reset() {
    if (object_ != nullptr) {
      (void)destroy(&object_);
      object_ = nullptr;
    }
  }

 private:
  T object_ = nullptr;
};

using MatHandle = Handle<Mat, MatDestroy>;
using VecHandle = Handle<Vec, VecDestroy>;
using IsHandle = Handle<IS, ISDestroy>;
using ScatterHandle = Handle<VecScatter, VecScatterDestroy>;
using EpsHandle = Handle<EPS, EPSDestroy>;
using BvHandle = Handle<BV, BVDestroy>;

}  // namespace carillon::petsc
