/* Factor and solve of one matrix with CHOLMOD and METIS ordering: user CPU, median of five, one thread.
 *
 *   apt-get install libsuitesparse-dev libopenblas0-serial
 *   gcc -O2 benches/cholmod.c -I/usr/include/suitesparse -lcholmod -lsuitesparseconfig -o /tmp/cholmod
 *   python3 benches/libigl.py PATCH.off --systems /tmp/system && /tmp/cholmod /tmp/system-lscm.mtx 1 /tmp/system-harmonic.mtx 2
 *
 * Arguments: pairs of a Matrix Market file (symmetric, one triangle) and the number of right-hand sides.
 */
#include <cholmod.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/resource.h>

static double user_seconds(void) {
    struct rusage u;
    getrusage(RUSAGE_SELF, &u);
    return u.ru_utime.tv_sec + 1e-6 * u.ru_utime.tv_usec;
}

static int compare(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double median(double *five) {
    qsort(five, 5, sizeof(double), compare);
    return five[2];
}

static void measure(const char *name, cholmod_sparse *matrix, int columns, int ordering, cholmod_common *c) {
    double analyze[5], factorize[5], solve[5], entries = 0, residual = 0;
    double one[2] = {1, 0}, minus[2] = {-1, 0};
    c->nmethods = 1;
    c->method[0].ordering = ordering;
    c->postorder = 1;
    cholmod_dense *b = cholmod_ones(matrix->nrow, columns, CHOLMOD_REAL, c);
    for (int turn = 0; turn < 5; turn++) {
        double t0 = user_seconds();
        cholmod_factor *factor = cholmod_analyze(matrix, c);
        double t1 = user_seconds();
        if (!cholmod_factorize(matrix, factor, c) || factor->minor < matrix->nrow) {
            printf("%s: not positive definite\n", name);
            exit(1);
        }
        double t2 = user_seconds();
        cholmod_dense *x = cholmod_solve(CHOLMOD_A, factor, b, c);
        double t3 = user_seconds();
        analyze[turn] = t1 - t0, factorize[turn] = t2 - t1, solve[turn] = t3 - t2, entries = c->lnz;
        cholmod_dense *r = cholmod_copy_dense(b, c);
        cholmod_sdmult(matrix, 0, minus, one, x, r, c);
        residual = cholmod_norm_dense(r, 0, c) / (cholmod_norm_sparse(matrix, 0, c) * cholmod_norm_dense(x, 0, c));
        cholmod_free_dense(&r, c);
        cholmod_free_dense(&x, c);
        cholmod_free_factor(&factor, c);
    }
    double a = median(analyze), f = median(factorize), s = median(solve);
    printf("%s: n %zu, %s, nnz(L) %.3g, analyze %.4f, factorize %.4f, solve of %d %.4f, all %.4f s user CPU, residual %.1e\n", name,
           matrix->nrow, ordering == CHOLMOD_METIS ? "METIS" : "AMD", entries, a, f, columns, s, a + f + s, residual);
    cholmod_free_dense(&b, c);
}

int main(int count, char **words) {
    cholmod_common c;
    cholmod_start(&c);
    for (int k = 1; k + 1 < count; k += 2) {
        FILE *file = fopen(words[k], "r");
        cholmod_sparse *matrix = file ? cholmod_read_sparse(file, &c) : NULL;
        if (!matrix) {
            printf("%s cannot be read\n", words[k]);
            return 1;
        }
        fclose(file);
        measure(words[k], matrix, atoi(words[k + 1]), CHOLMOD_METIS, &c);
        measure(words[k], matrix, atoi(words[k + 1]), CHOLMOD_AMD, &c);
        cholmod_free_sparse(&matrix, &c);
    }
    return cholmod_finish(&c) ? 0 : 1;
}
