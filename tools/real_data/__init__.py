"""Public recordings of real drives: imported, diagnosed, judged on data held out, beside what authors published.

python -m tools.real_data --data FOLDER --out FOLDER [--sets emps,so101_jaw,…] [--page]
"""
