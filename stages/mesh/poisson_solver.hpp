// Poisson solver: conjugate gradients in the place of PCL's, whose rows lie all over memory, one piece each: two
// threads that read them take as long as one.  Here they lie one behind the other.  All additions and their order are
// PCL's, so the bits are.
#pragma once

#include <pcl/surface/3rdparty/poisson4/sparse_matrix.h>

#include <algorithm>
#include <memory>
#include <vector>

namespace pcl::poisson
{

// A symmetric matrix: one triangle, with half of each entry of the diagonal, as PCL has it.  Rows are shared among
// `parts` threads.
class PackedMatrix
{
  public:
    PackedMatrix(const SparseSymmetricMatrix<float> &matrix, int parts)
        : rows_(size_t(matrix.rows)), parts_(size_t(parts)), begin_(rows_ + 1), shares_(rows_ * parts_)
    {
        for (size_t i = 0; i < rows_; i++) begin_[i + 1] = begin_[i] + size_t(matrix.rowSizes[i]);
        entries_.reset(new MatrixEntry<float>[begin_.back()]);
#pragma omp parallel for num_threads(parts)
        for (size_t t = 0; t < parts_; t++)
            for (size_t i = first_of(t); i < first_of(t + 1); i++)
                std::copy_n(matrix[int(i)], begin_[i + 1] - begin_[i], &entries_[begin_[i]]);
    }

    // out = A in.  fixes_mean: the mean of `in` is added to all of it, which makes up for what a constant does not change.
    void multiply(float *out, const float *in, bool fixes_mean)
    {
        float mean = 0;
#pragma omp parallel for num_threads(int(parts_)) reduction(+ : mean)
        for (size_t t = 0; t < parts_; t++) {
            std::fill_n(&shares_[t * rows_], rows_, 0.0f);
            add_rows(t, in);
            for (size_t i = first_of(t); i < first_of(t + 1) && fixes_mean; i++) mean += in[i];
        }
        mean /= float(rows_);
#pragma omp parallel for num_threads(int(parts_))
        for (size_t i = 0; i < rows_; i++) {
            out[i] = mean;
            for (size_t t = 0; t < parts_; t++) out[i] += shares_[t * rows_ + i];
        }
    }

  private:
    size_t first_of(size_t part) const
    {
        return rows_ * part / parts_;
    }

    // What the part's rows have in the product.  The sum of a row stays in a register.
    void add_rows(size_t part, const float *__restrict in)
    {
        float *__restrict out = &shares_[part * rows_];
        for (size_t i = first_of(part); i < first_of(part + 1); i++) {
            const MatrixEntry<float> *__restrict entry = &entries_[begin_[i]],
                                                 *end = &entries_[begin_[i + 1]];
            float sum = out[i];
            for (; entry < end; entry++) {
                size_t j = size_t(entry->N);
                float value = entry->Value;
                sum += value * in[j];
                if (j == i)
                    sum += value * in[i];
                else
                    out[j] += value * in[i];
            }
            out[i] = sum;
        }
    }

    const size_t rows_, parts_;
    std::vector<size_t> begin_; // rows + 1: of each row's entries
    std::unique_ptr<MatrixEntry<float>[]> entries_;
    std::vector<float> shares_; // parts x rows
};

// In the place of PCL's: x, where it starts, becomes the solution, to a residual of `accuracy` times the first one.
// Returns the steps; none where that is below `accuracy` itself.  In the 50th PCL looks at the residual anew, and takes that step twice.
inline int solve(const SparseSymmetricMatrix<float> &of, const Vector<float> &right, int most,
                 Vector<float> &x, float accuracy, int parts, bool fixes_mean)
{
    PackedMatrix matrix(of, parts);
    const float *b = &right[0];
    int n = of.rows, step = 0;
    std::vector<float> r(size_t(n), 0), d(size_t(n), 0), q(size_t(n), 0);
    double square = 0;
    matrix.multiply(r.data(), &x[0], fixes_mean);
#pragma omp parallel for num_threads(parts) reduction(+ : square)
    for (int i = 0; i < n; i++) {
        d[i] = r[i] = b[i] - r[i];
        square += r[i] * r[i];
    }
    const double least = double(accuracy * accuracy), enough = least * square;
    if (square < least) return 0;
    for (; step < most && square > enough; step++) {
        double along = 0, before = square;
        matrix.multiply(q.data(), d.data(), fixes_mean);
#pragma omp parallel for num_threads(parts) reduction(+ : along)
        for (int i = 0; i < n; i++) along += d[i] * q[i];
        float share = float(square / along);
        bool is_anew = step % 50 == 49;
        if (is_anew) {
            for (int i = 0; i < n; i++) x[i] += d[i] * share;
            matrix.multiply(r.data(), &x[0], fixes_mean);
        }
        square = 0;
#pragma omp parallel for num_threads(parts) reduction(+ : square)
        for (int i = 0; i < n; i++) {
            r[i] = is_anew ? b[i] - r[i] : r[i] - q[i] * share;
            square += r[i] * r[i];
            x[i] += d[i] * share;
        }
        float kept = float(square / before);
#pragma omp parallel for num_threads(parts)
        for (int i = 0; i < n; i++) d[i] = r[i] + d[i] * kept;
    }
    return step;
}

// Both ways in which PCL asks: without room for products, and with it.
template <>
template <>
int SparseSymmetricMatrix<float>::Solve<float>(const SparseSymmetricMatrix<float> &matrix,
                                               const Vector<float> &b, int steps, Vector<float> &x,
                                               float accuracy, int, int threads, bool fixes_mean, bool)
{
    return matrix.rows ? solve(matrix, b, steps, x, accuracy, threads, fixes_mean) : 0;
}

template <>
template <>
int SparseSymmetricMatrix<float>::Solve<float>(const SparseSymmetricMatrix<float> &matrix,
                                               const Vector<float> &b, int steps, Vector<float> &x,
                                               MapReduceVector<float> &room, float accuracy, int,
                                               bool fixes_mean, bool)
{
    return matrix.rows ? solve(matrix, b, steps, x, accuracy, room.threads(), fixes_mean) : 0;
}

} // namespace pcl::poisson
