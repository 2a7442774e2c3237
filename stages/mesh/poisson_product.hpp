// Poisson product: the product of matrix and vector in which PCL's reconstruction spends half of its time.
// PCL's own sums through memory, each addition waiting for the one before to be stored and loaded again; here
// the sum of a row stays in a register.  The additions and their order are PCL's, so the bits are.
#pragma once

#include <pcl/surface/3rdparty/poisson4/sparse_matrix.h>

#include <cstring>

namespace pcl::poisson
{

// The share that rows [first, last) have in out = matrix in.  The matrix has one triangle, and half of each
// entry of its diagonal.
inline void add_rows(const SparseSymmetricMatrix<float> &matrix, int first, int last, float *__restrict out,
                     const float *__restrict in)
{
    for (int i = first; i < last; i++) {
        const MatrixEntry<float> *__restrict entry = matrix[i];
        float sum = out[i];
        for (int k = 0; k < matrix.rowSizes[i]; k++) {
            int j = entry[k].N;
            float value = entry[k].Value;
            sum += value * in[j];
            if (j == i)
                sum += value * in[i];
            else
                out[j] += value * in[i];
        }
        out[i] = sum;
    }
}

// In the place of PCL's, for all its solvers.  shares: one for each thread; fixes_mean: the mean of in is
// added to all of out, which makes up for what a constant does not change.
template <>
template <>
void SparseSymmetricMatrix<float>::Multiply<float>(const Vector<float> &in, Vector<float> &out,
                                                   MapReduceVector<float> &shares, bool fixes_mean) const
{
    int count = int(in.Dimensions()), threads = shares.threads();
    float mean = 0;
#pragma omp parallel for num_threads(threads) reduction(+ : mean)
    for (int t = 0; t < threads; t++) {
        int first = rows * t / threads, last = rows * (t + 1) / threads;
        std::memset(shares[t], 0, sizeof(float) * size_t(count));
        add_rows(*this, first, last, shares[t], &in[0]);
        for (int i = first; i < last && fixes_mean; i++) mean += in[size_t(i)];
    }
    mean /= float(count);
    for (int i = 0; i < count; i++) {
        float sum = mean;
        for (int t = 0; t < threads; t++) sum += shares[t][i];
        out[size_t(i)] = sum;
    }
}

} // namespace pcl::poisson
