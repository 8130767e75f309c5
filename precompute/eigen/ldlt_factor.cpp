
#include "precompute/eigen/shifted_factor.hpp"
#include "precompute/ldlt/factor.hpp"
#include "precompute/petsc/session.hpp"

namespace carillon::eigen {
namespace {

class LdltFactor final : public ShiftedFactor {
 public:
  LdltFactor(const la::Pencil& pencil, const ldlt::MeshOrder* order)
      : factor_(pencil, order), rank_(petsc::get_communicator(pencil.stiffness).rank()) {}

  bool try_factorise(double sigma) override { return factor_.factorise(sigma); }
  void solve(const double* b, double* x, std::ptrdiff_t stride, int columns) override {
    factor_.solve(b, x, petsc::to_petsc_int(stride), columns);
  }
  std::int64_t get_negative_pivots() const override { return factor_.get_negative_pivots(); }
  double get_backward_error() const override { return factor_.get_backward_error(); }
  std::int64_t get_peak_bytes() const override { return factor_.get_analysis().ranks[rank_].peak_bytes; }
  std::string get_solver() const override { return "carillon L D L^T"; }
  std::string get_ordering() const override { return "METIS nested dissection, a separator tree over the ranks"; }
  std::int64_t get_entries() const override { return factor_.get_analysis().entries; }
  double get_flops() const override { return factor_.get_analysis().flops; }

 private:
  ldlt::Factor factor_;
  int rank_;
};

}  // namespace

std::unique_ptr<ShiftedFactor> make_ldlt_factor(const la::Pencil& pencil, const ldlt::MeshOrder* order) {
  return std::make_unique<LdltFactor>(pencil, order);
}

}  // namespace carillon::eigen
