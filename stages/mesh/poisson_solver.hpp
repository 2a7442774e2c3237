// Poisson solver: conjugate gradients in the place of PCL's, whose rows lie all over memory, one piece each: two
// threads that read them were slower than one.  Here they lie one behind the other, and a step is divided by the
// diagonal (Jacobi), so that the same accuracy takes half of the steps where points weigh on some cells alone.
#pragma once

#include <pcl/surface/3rdparty/poisson4/sparse_matrix.h>

#include <algorithm>
#include <memory>
#include <vector>

namespace pcl::poisson
{

// Of A x = b, A symmetric and positive: one triangle of it, with half of each entry of the diagonal, as PCL has it.
// Rows are shared among `parts` threads; equal input and parts give equal bits.
class ConjugateGradients
{
  public:
    // fixes_mean: the mean of x is added to all of A x, which makes up for what a constant does not change.
    ConjugateGradients(const SparseSymmetricMatrix<float> &matrix, int parts, bool fixes_mean)
        : rows_(size_t(matrix.rows)), parts_(size_t(parts)), fixes_mean_(fixes_mean), begin_(rows_ + 1),
          inverse_(rows_, 1), shares_(rows_ * parts_), sums_(parts_)
    {
        for (size_t i = 0; i < rows_; i++) begin_[i + 1] = begin_[i] + size_t(matrix.rowSizes[i]);
        entries_.reset(new MatrixEntry<float>[begin_.back()]);
        each_part([&](size_t, size_t first, size_t last) {
            for (size_t i = first; i < last; i++) take_row(i, matrix[int(i)]);
        });
    }

    // x, where it starts, becomes the solution, to a residual of `accuracy` times the first one.  Returns the steps.
    int solve(float *x, const float *b, int steps_most, double accuracy)
    {
        std::vector<float> r(rows_), d(rows_), q(rows_); // residual, way, A way
        multiply(q.data(), x);
        Sums now = sum_up([&](size_t i) {
            r[i] = b[i] - q[i];
            d[i] = inverse_[i] * r[i];
            return Sums{double(r[i]) * double(d[i]), double(r[i]) * double(r[i])};
        });
        const double enough = accuracy * accuracy * now.square;
        int step = 0;
        for (; step < steps_most && now.square > enough; step++) {
            multiply(q.data(), d.data());
            Sums along = sum_up([&](size_t i) { return Sums{double(d[i]) * double(q[i]), 0}; });
            const float share = float(now.scaled / along.scaled);
            const double before = now.scaled;
            now = sum_up([&](size_t i) {
                x[i] += d[i] * share;
                r[i] -= q[i] * share;
                double square = double(r[i]) * double(r[i]);
                return Sums{square * double(inverse_[i]), square};
            });
            const float kept = float(now.scaled / before);
            each_part([&](size_t, size_t first, size_t last) {
                for (size_t i = first; i < last; i++) d[i] = inverse_[i] * r[i] + d[i] * kept;
            });
        }
        return step;
    }

  private:
    struct Sums {
        double scaled, square;
    };

    // do_part(part, first row, last row)
    template <typename Part> void each_part(Part do_part)
    {
#pragma omp parallel for num_threads(int(parts_))
        for (size_t t = 0; t < parts_; t++) do_part(t, rows_ * t / parts_, rows_ * (t + 1) / parts_);
    }

    // The sum of add(row), in the order of rows and parts.
    template <typename Add> Sums sum_up(Add add)
    {
        each_part([&](size_t t, size_t first, size_t last) {
            Sums sums = {0, 0};
            for (size_t i = first; i < last; i++) {
                Sums of = add(i);
                sums.scaled += of.scaled;
                sums.square += of.square;
            }
            sums_[t] = sums;
        });
        Sums all = {0, 0};
        for (const Sums &sums : sums_) {
            all.scaled += sums.scaled;
            all.square += sums.square;
        }
        return all;
    }

    void take_row(size_t i, const MatrixEntry<float> *from)
    {
        for (size_t k = begin_[i]; k < begin_[i + 1]; k++, from++) {
            entries_[k] = *from;
            if (size_t(from->N) == i && from->Value > 0) inverse_[i] = 1 / (2 * from->Value);
        }
    }

    // The share that rows [first, last) have in out = A in.  The sum of a row stays in a register.
    void add_rows(size_t first, size_t last, float *__restrict out, const float *__restrict in) const
    {
        for (size_t i = first; i < last; i++) {
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

    void multiply(float *out, const float *in)
    {
        float mean = 0;
        for (size_t i = 0; fixes_mean_ && i < rows_; i++) mean += in[i] / float(rows_);
        each_part([&](size_t t, size_t first, size_t last) {
            float *share = &shares_[t * rows_];
            std::fill_n(share, rows_, 0.0f);
            add_rows(first, last, share, in);
        });
        each_part([&](size_t, size_t first, size_t last) {
            for (size_t i = first; i < last; i++) {
                out[i] = mean;
                for (size_t t = 0; t < parts_; t++) out[i] += shares_[t * rows_ + i];
            }
        });
    }

    const size_t rows_, parts_;
    const bool fixes_mean_;
    std::vector<size_t> begin_; // rows + 1: of each row's entries
    std::unique_ptr<MatrixEntry<float>[]> entries_;
    std::vector<float> inverse_, shares_; // of the diagonal; parts x rows
    std::vector<Sums> sums_;              // of each part
};

// Both ways in which PCL asks: with room for products, and without.
template <>
template <>
int SparseSymmetricMatrix<float>::Solve<float>(const SparseSymmetricMatrix<float> &matrix,
                                               const Vector<float> &b, int steps, Vector<float> &x,
                                               float accuracy, int, int threads, bool fixes_mean, bool)
{
    if (!matrix.rows) return 0;
    return ConjugateGradients(matrix, threads, fixes_mean).solve(&x[0], &b[0], steps, double(accuracy));
}

template <>
template <>
int SparseSymmetricMatrix<float>::Solve<float>(const SparseSymmetricMatrix<float> &matrix,
                                               const Vector<float> &b, int steps, Vector<float> &x,
                                               MapReduceVector<float> &room, float accuracy, int reset,
                                               bool fixes_mean, bool is_normal)
{
    return Solve(matrix, b, steps, x, accuracy, reset, room.threads(), fixes_mean, is_normal);
}

} // namespace pcl::poisson
